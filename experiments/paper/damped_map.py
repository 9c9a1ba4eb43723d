"""The map under damping and static friction.

Segments are wider, slopes are smaller, and each edge has a jump. With x_s above x_d the triangle wave of Fig. 4 becomes
a sawtooth: its distances give mu, its height mu_s.
"""

import itertools
from typing import Any, NamedTuple

import closed_form
import edges
import numpy as np
from common import Number, Study, simulated_machine

import fricjax as fj

MU = 0.1
DAMPING_RATIOS, RATIOS = (0.0, 0.01, 0.1), (1.0, 1.3, 2.5)
REACH = 4e-3
BRACKETS, FINE = np.linspace(0.0, REACH, 81), np.linspace(0.0, REACH, 2001)


class Sawtooth(NamedTuple):
    """The map of one machine."""

    damping_ratio: float
    ratio: float
    exact: closed_form.HalfCycleMap
    edges: edges.Edges
    final: np.ndarray


def study() -> Study:
    """Combine all damping ratios and ratios of static friction."""
    found = [_sawtooth(zeta, ratio) for zeta, ratio in itertools.product(DAMPING_RATIOS, RATIOS)]
    numbers = [number for each in found for number in _numbers(each)]
    rows = np.concatenate([_rows(each) for each in found])
    heads = ("Damping ratio", "mu_s/mu", "Half-cycles", "Edge [m]", "Width [m]", "Slope", "Jump [m]")
    note = (
        "The machine of Fig. 2 with damping ratios of 0, 1 and 10 % and with mu_s/mu of 1, 1.3 and 2.5. Segment n "
        "is the range of n half-cycles; edges are found by bisection in the map. Damping stretches the "
        "abscissa and leaves the amplitude mu_s N/k. Equal coefficients give a continuous map, unequal ones a jump "
        "at each edge. If mu_s exceeds 2 mu, the undamped mass never stops near the equilibrium. Widths and "
        "slopes are those of the first and the last whole segment; all others are in the data."
    )
    columns: dict[str, Any] = dict(zip(heads, rows.T, strict=True))
    return Study("The map with damping and static friction", note, numbers, columns, _picture(found))


def _sawtooth(zeta: float, ratio: float) -> Sawtooth:
    machine = simulated_machine(zeta, MU, ratio * MU)
    final = np.asarray(edges.displacement_and_slope(machine, FINE)[0])
    return Sawtooth(zeta, ratio, closed_form.of(machine), edges.find(machine, BRACKETS), final)


def _rows(saw: Sawtooth) -> np.ndarray:
    """Return one row for each segment between two edges."""
    x0, below, above, slope = (values[:-1] for values in saw.edges)
    n = np.arange(1, x0.size + 1)
    same = np.ones(x0.size)
    return np.stack(
        [saw.damping_ratio * same, saw.ratio * same, n, x0, np.diff(saw.edges.x0), slope, np.abs(above - below)], axis=1
    )


def _numbers(saw: Sawtooth) -> tuple[Number, ...]:
    exact, rows = saw.exact, _rows(saw)
    first, last = rows[0], rows[-1]
    n = len(rows)
    name = f"damping {saw.damping_ratio:.0%}, mu_s/mu {saw.ratio:g}"
    return (
        Number(f"{name}: width of segment 1", "m", first[4], exact.edge(1) - exact.edge(0)),
        Number(f"{name}: width of segment {n}", "m", last[4], exact.edge(n) - exact.edge(n - 1)),
        Number(f"{name}: slope of segment {n}", "", last[5], exact.slope(n)),
        Number(f"{name}: jump at its edges", "m", float(np.max(rows[:, 6])), exact.jump),
        Number(f"{name}: amplitude", "m", float(np.max(np.abs(saw.edges.below))), exact.static_band),
    )


def _picture(found: list[Sawtooth]) -> Any:
    picture, axes = fj.show.figure(len(DAMPING_RATIOS), 1, share_x=True)
    for only, zeta in zip(axes[:, 0], DAMPING_RATIOS, strict=True):
        same = [saw for saw in found if saw.damping_ratio == zeta]
        for saw, width in zip(same, (3.6, 2.2, 0.9), strict=True):
            only.plot(1e3 * FINE, 1e3 * saw.final, linewidth=width, label=f"mu_s/mu = {saw.ratio:g}")
        only.set_title(f"damping ratio {100 * zeta:g} %", fontsize=9, loc="left")
        only.set_ylabel("Final displ. xf [mm]")
        only.set_ylim(-0.55, 0.75)
    axes[0, 0].legend(loc="upper right", ncols=3, fontsize=8)
    axes[-1, 0].set_xlabel("Initial displacement x0 [mm]")
    return picture
