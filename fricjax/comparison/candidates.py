"""Candidate laws of a comparison: free coefficients and common samples."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from ..data import Record, Trace
from ..errors import DataError, UsageError, check_type, nearest
from ..fitting.names import check_identifiable, of_run
from ..fitting.parameters import Request
from ..fitting.problem import windows_of
from ..fitting.window import Window
from ..friction.base import law_name
from ..oscillator import Oscillator, Program
from ..oscillator.oscillator import leaves_of
from ..settings import check_different

_TABLES = ("bounds", "priors", "tie", "guess")
# Speeds at which the derivatives of a law are evaluated [m/s]: those of a decay by decades, and one negative velocity.
_SPEEDS = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1, -3e-3)


@dataclasses.dataclass(frozen=True)
class Candidate:
    """A law of a comparison.

    Attributes:
        name: name in the rows of the comparison.
        request: settings of its fit.
        windows: the fitted part of each record, or the error that prevents a fit.
    """

    name: str
    request: Request
    windows: tuple[Window, ...] | DataError | UsageError


def candidates(
    records: Sequence[Record | Trace],
    oscillators: Sequence[Oscillator],
    free: Sequence[Sequence[str]] | None,
    names: Sequence[str] | None,
    settings: Mapping[str, Any],
) -> list[Candidate]:
    """Build the candidates on samples that all of them can fit.

    Raises:
        UsageError: lists have different lengths, or an entry belongs to no candidate.
        DataError: no candidate can be fitted to the records.
    """
    check_type("oscillators", oscillators, list | tuple, "a list of oscillators")
    check_type("free", free, list | tuple | None, "a list with the names of each law")
    for entry in free or ():
        check_type("An entry of free", entry, list | tuple, "a list of names")
    lists = [tuple(entry) for entry in (map(identifiable_coefficients, oscillators) if free is None else free)]
    laws = [law_name(machine.friction) for machine in oscillators]
    if names is None:
        # Number the laws that occur several times.
        numbers = [laws[: i + 1].count(law) for i, law in enumerate(laws)]
        names = [law if laws.count(law) == 1 else f"{law} {n}" for law, n in zip(laws, numbers, strict=True)]
    for entries, noun in ((lists, "lists of free coefficients"), (names, "names")):
        if len(entries) != len(oscillators):
            raise UsageError(f"There are {len(oscillators)} oscillators but {len(entries)} {noun}. Give one for each.")
    check_different(names)
    _check_tables(settings, oscillators, lists)
    requests = [_request(*pair, settings) for pair in zip(oscillators, lists, strict=True)]
    opened: list[tuple[Window, ...] | DataError | UsageError] = []
    for request in requests:
        try:
            opened.append(windows_of(records, request))
        except (DataError, UsageError) as error:
            opened.append(error)
    usable = [windows for windows in opened if isinstance(windows, tuple)]
    if not usable:
        raise next(windows for windows in opened if isinstance(windows, Exception))
    common = [np.logical_and.reduce([windows[i].used for windows in usable]) for i in range(len(records))]
    entered = []
    for name, request, windows in zip(names, requests, opened, strict=True):
        if isinstance(windows, tuple):
            # Samples that repeat by rounding are left out for all laws.
            windows = tuple(
                dataclasses.replace(window, used=used, moving=window.moving & used, repeated=np.zeros_like(used))
                for window, used in zip(windows, common, strict=True)
            )
        entered.append(Candidate(name, request, windows))
    return entered


def identifiable_coefficients(oscillator: Oscillator) -> tuple[str, ...]:
    """Select the coefficients that a comparison frees by default.

    These are damping, stiffness, and the coefficients that determine the sliding force of the law. The following are
    excluded: the static coefficient of Coulomb's law, shapes (numbers without a unit that are not coefficients of
    friction, such as exponents), the width of a regularisation, and a coefficient with the same effect as another free
    one.
    """
    leaves, structure = jax.tree.flatten(oscillator)
    # Evaluate near the given values, which may be special: with mu_s = mu a law does not depend on v_stribeck.
    at = [np.asarray(float(leaf) * (1 + 0.01 * i)) for i, leaf in enumerate(leaves)]
    slopes = np.asarray(_slopes(jax.tree.unflatten(structure, at)))
    free = ["damping", "stiffness"]
    for leaf in leaves_of(oscillator):
        acts = leaf.dotted.startswith("friction.") and np.any(slopes[..., leaf.index] != 0)
        if not acts or leaf.kind == "v_s" or not (leaf.unit or leaf.kind.startswith("mu")):
            continue
        try:
            check_identifiable([*free, leaf.name], leaves_of(oscillator))
        except UsageError:
            continue
        free.append(leaf.name)
    return (*free[2:], *free[:2])


def _slopes_of(oscillator: Oscillator) -> Array:
    """Derivatives of the friction force and state rates by all leaves."""
    leaves, structure = jax.tree.flatten(oscillator)

    def forces(values: Array, v: Array) -> Array:
        machine = jax.tree.unflatten(structure, list(values))
        law, load = machine.friction, machine.normal_force
        state = 0.4 * law.state_scale(load)
        return jnp.append(law.rate(v, state, load), law.force(v, state, load))

    return jax.vmap(jax.jacfwd(forces), (None, 0))(jnp.stack(leaves), jnp.asarray(_SPEEDS))


_slopes = Program(_slopes_of, lambda _: 0)


def _check_tables(
    settings: Mapping[str, Any], oscillators: Sequence[Oscillator], free: Sequence[Sequence[str]]
) -> None:
    """Refuse entries of tables that belong to no candidate."""
    known = {name for machine, names in zip(oscillators, free, strict=True) for name in (*_leaf_names(machine), *names)}
    for table in _TABLES:
        for name in settings.get(table) or {}:
            if name not in known and not of_run(name):
                raise UsageError(
                    f"{table} names {name!r}, which no candidate has.{nearest(name, known)} "
                    f"There are {', '.join(sorted(known))}."
                )


def _leaf_names(oscillator: Oscillator) -> list[str]:
    return [name for leaf in leaves_of(oscillator) for name in (leaf.name, leaf.dotted)]


def _request(oscillator: Oscillator, free: tuple[str, ...], settings: Mapping[str, Any]) -> Request:
    """Build the settings of the fit of one candidate."""
    used = dict(settings)
    for table in _TABLES:
        names = _leaf_names(oscillator) if table == "tie" else free
        entries = (used.get(table) or {}).items()
        used[table] = {name: entry for name, entry in entries if name in names or of_run(name)}
    return Request.of(oscillator, free, **used)
