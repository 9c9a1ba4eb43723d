"""The two kinds of refusal on the host side, before any number reaches traced code.

A record can be unusable (`DataError`), or a question can be put wrongly (`UsageError`). Both are plain `ValueError`s
whose message names what was wrong, what was got, and the remedy; `nearest` adds the guess at what was meant.

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
import reprlib
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Any


class DataError(ValueError):
    """A file or a record that cannot be used as it is. The command line ends with exit code 4."""


class UsageError(ValueError):
    """A wrong option, name or combination of settings. The command line ends with exit code 2."""


def needed(what: str, module: str, extra: str, otherwise: str = "") -> Any:
    """A module of a package that an extra of this one brings, for those who need it.

    Args:
        what: who needs it, the subject of the sentence: "run.tdms", "A query".
        module: its name.
        extra: the extra by which pip installs it.
        otherwise: what can be done without it, as "or export the run as .csv".

    Raises:
        UsageError: it is not installed; says how to install it.
    """
    try:
        return importlib.import_module(module)
    except ImportError as error:
        package, way = module.partition(".")[0], f", {otherwise}" if otherwise else ""
        raise UsageError(f"{what} needs the package {package}: pip install 'fricjax[{extra}]'{way}.") from error


def nearest(name: object, options: Iterable[object]) -> str:
    """Returns `" Did you mean 'x'?"` for the option closest to `name`, or an empty string where none is close."""
    lowered = {str(option).lower(): str(option) for option in options}
    close = difflib.get_close_matches(str(name).lower()[:100], list(lowered), n=1, cutoff=0.5)
    return f" Did you mean '{lowered[close[0]]}'?" if close else ""


def check_choice(what: str, name: object, known: Collection[str]) -> None:
    """Refuse a name that is none of those that are known.

    Args:
        what: what it is a name of, "loss".
        name: the name.
        known: those that there are.

    Raises:
        UsageError: offers the nearest one, and names all.

    Examples:
        >>> check_choice("loss", "hubert", ("squares", "huber"))
        Traceback (most recent call last):
        ...
        fricjax.errors.UsageError: There is no loss 'hubert'. Did you mean 'huber'? Choose one of squares, huber.
    """
    if name not in known:
        raise UsageError(f"There is no {what} {brief(name)}.{nearest(name, known)} Choose one of {', '.join(known)}.")


def suggesting(package: str, get: Callable[[str], Any], names: Sequence[str]) -> Callable[[str], Any]:
    """The `__getattr__` of a lazy package, which for a name that it does not have says which one may be meant.

    Args:
        package: its name.
        get: the `__getattr__` that it has.
        names: those it exports.

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
            if name.startswith("__"):  # asked for by Python itself, which expects no answer
                raise
            # Python would add a guess of its own to an error that names no object.
            raise AttributeError(f"{package} has no {name!r}.{nearest(name, names)}", name=name, obj=None) from error

    return getattr_of_package


def quoted(names: Sequence[object], limit: int = 12) -> str:
    """`'a', 'b' and 3 more`: names for a sentence, long ones and long lists cut."""
    return first_of((f"'{name if len(str(name)) <= 60 else f'{str(name)[:57]}...'}'" for name in names), limit)


def first_of(words: Iterable[object], limit: int = 3) -> str:
    """`a, b and 3 more`: the first words for a sentence, and how many there are besides."""
    every = list(map(str, words))
    return ", ".join(every[:limit]) + (f" and {len(every) - limit} more" if len(every) > limit else "")


_BRIEF = reprlib.Repr(maxlevel=3, maxstring=80, maxother=80, maxlong=40)


def brief(value: object) -> str:
    """A value as messages show it, however long or deep it is."""
    try:
        return _BRIEF.repr(value)
    except ValueError:  # more digits than may be turned into decimal ones
        return "a number of thousands of digits"
