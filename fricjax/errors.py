"""Errors that fricjax raises before any number reaches traced code.

A `DataError` means that a record is unusable, a `UsageError` that an option, a name or a combination of settings is
wrong. Both are `ValueError`s. The message names the problem, the value received and the remedy. `nearest` suggests the
closest known name.

Examples:
    >>> import fricjax as fj
    >>> try:
    ...     fj.Rig(mass=0.41, stiffness=2574.0, normal_force=9.66, restoring="pendelum")
    ... except fj.errors.UsageError as error:
    ...     print(error)
    There is no restoring force 'pendelum'; known are linear, cubic, pendulum. Did you mean 'pendulum'?
"""

import difflib
import importlib
import os
import reprlib
from collections.abc import Callable, Collection, Iterable, Sequence
from pathlib import Path
from typing import Any


class DataError(ValueError):
    """An unusable file or record. The command line exits with code 4."""


class UsageError(ValueError):
    """A wrong option, name or combination of settings; exit code 2."""


def needed(subject: str, module: str, extra: str, otherwise: str = "") -> Any:
    """Import a module of an optional dependency.

    Args:
        subject: file or feature that needs the module, the subject of the error message: "run.tdms", "A query".
        module: name of the module.
        extra: extra of fricjax with which pip installs the package.
        otherwise: an alternative without the package, such as "or export the run as .csv".

    Raises:
        UsageError: the package is not installed; the message says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package, way = module.partition(".")[0], f", {otherwise}" if otherwise else ""
        raise UsageError(f"{subject} needs the package {package}: pip install 'fricjax[{extra}]'{way}.") from error


def nearest(name: object, options: Iterable[object]) -> str:
    """Return " Did you mean 'x'?", or "" without a close option."""
    lowered = {str(option).lower(): str(option) for option in options}
    close = difflib.get_close_matches(str(name).lower()[:100], list(lowered), n=1, cutoff=0.5)
    return f" Did you mean '{lowered[close[0]]}'?" if close else ""


def check_choice(kind: str, name: object, known: Collection[str]) -> None:
    """Refuse an unknown name.

    Args:
        kind: noun for the error message, such as "loss".
        name: the name to check.
        known: the valid names.

    Raises:
        UsageError: the name is unknown; the message suggests the nearest valid name and lists all of them.

    Examples:
        >>> check_choice("loss", "hubert", ("squares", "huber"))
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: There is no loss 'hubert'. Did you mean 'huber'? Choose one of squares, huber.
    """
    if not isinstance(name, str) or name not in known:
        raise UsageError(f"There is no {kind} {brief(name)}.{nearest(name, known)} Choose one of {', '.join(known)}.")


def check_type(name: str, value: object, types: Any, expected: str) -> None:
    """Refuse a value of another type.

    Args:
        name: name of the argument.
        value: its value.
        types: the valid types, as for `isinstance`.
        expected: description of valid values, such as "an Oscillator".

    Raises:
        UsageError: the message states name, value and valid values.

    Examples:
        >>> check_type("bounds", 3.0, dict, "a mapping from names to pairs")
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: bounds must be a mapping from names to pairs, but it is 3.0.
    """
    if not isinstance(value, types):
        raise UsageError(f"{name} must be {expected}, but it is {brief(value)}.")


def suggesting(package: str, get: Callable[[str], Any], names: Sequence[str]) -> Callable[[str], Any]:
    """Return a `__getattr__` for a lazy package that suggests the nearest name.

    Args:
        package: name of the package.
        get: the original `__getattr__` of the package.
        names: the exported names.

    Examples:
        >>> import fricjax as fj
        >>> fj.friction.Coulumb
        Traceback (most recent call last):
        ...
        AttributeError: fricjax.friction has no 'Coulumb'. Did you mean 'Coulomb'?
    """

    def getattr_of_package(name: str) -> Any:
        try:
            return get(name)
        except AttributeError as error:
            if name.startswith("__"):  # Python itself probes for such names
                raise
            # Without obj=None Python would append a second suggestion to the message.
            raise AttributeError(f"{package} has no {name!r}.{nearest(name, names)}", name=name, obj=None) from error

    return getattr_of_package


def path_of(value: Any) -> Path:
    """Return an argument as a path.

    Raises:
        UsageError: it is no path.
    """
    check_type("path", value, (str, os.PathLike), "the name of a file or folder")
    return Path(value)


def quoted(names: Sequence[object], limit: int = 12) -> str:
    """Quote names for a sentence, as `'a', 'b' and 3 more`."""
    return first_of((f"'{name if len(str(name)) <= 60 else f'{str(name)[:57]}...'}'" for name in names), limit)


def first_of(words: Iterable[object], limit: int = 3) -> str:
    """Join the first words for a sentence: `a, b and 3 more`."""
    every = list(map(str, words))
    return ", ".join(every[:limit]) + (f" and {len(every) - limit} more" if len(every) > limit else "")


_BRIEF = reprlib.Repr(maxlevel=3, maxstring=80, maxother=80, maxlong=40)


def brief(value: object) -> str:
    """Return a short representation of any value for a message."""
    try:
        return _BRIEF.repr(value)
    except ValueError:  # an integer with more digits than Python converts to decimal
        return "a number of thousands of digits"
