"""Accuracy of the table engine against DOP853 with variational equations.

    python experiments/tables/run.py [fixed] [random] [grazing] [--count N]

Errors of the displacement are scaled to a release from 2 mm. Those of the columns are relative to the largest value of
the column. Turning points of the mesh are off by one per cent, like those of a rough start. A result is accepted if
it is resolved and a second mesh agrees in displacement and columns. Otherwise the mesh about the fastest place
and then one with twice the points are tried.
"""

import argparse
import time
from collections.abc import Iterable
from typing import Literal

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

from experiments.tables import cases, oracle  # noqa: E402
from fricjax.tables import Decay, Start, Tabulation, choose_layout, decay, error, make_mesh  # noqa: E402

LARGEST, LARGEST_LOOSE, LARGEST_COLUMN = 0.1e-9 / 2e-3, 0.3e-9 / 2e-3, 1e-7
# The difference of two meshes with errors of the same size.
ACCEPTED, ACCEPTED_COLUMN = LARGEST / 2, LARGEST_COLUMN / 2
SAMPLES = 40
"""Samples in a half-cycle of the undisturbed motion."""


def attempt(
    case: cases.Case, points: np.ndarray, ts: np.ndarray, rests: bool, centre: Literal["onset", "fastest"], finer: bool
) -> tuple[Decay, bool, float]:
    """Return the motion, whether it is accepted, and its estimated error.

    The error is relative to the initial displacement.
    """
    reach = max(abs(case.x0), float(np.max(np.abs(points))))
    rate = float(np.sqrt(case.oscillator.stiffness / case.oscillator.mass))
    secant = float(case.oscillator.restoring_force(np.float64(reach)) / (case.oscillator.stiffness * reach))
    tabulation = Tabulation(case.oscillator, case.free, 1.3 * reach * rate * max(1.0, secant**0.5), 1.1 * reach)
    forces = tabulation(tabulation.values)
    start = Start(case.x0, np.eye(tabulation.columns)[-1])
    layout = choose_layout(case.oscillator, forces, points)
    layout = layout.finer() if finer else layout
    mesh = make_mesh(case.oscillator, forces, points, layout=layout, centre=centre)
    rough = decay(forces, mesh, start, ts, rests, 8)
    if not np.all(np.isfinite(rough.amplitudes)):
        return rough, False, np.nan
    mesh, motions = mesh._replace(amplitudes=rough.amplitudes), []
    for check in (False, True):
        mesh = make_mesh(
            case.oscillator, forces, rough.turning_points, layout=layout, centre=centre, check=check, previous=mesh
        )
        motions.append(decay(forces, mesh, start, ts, rests, 4))
    estimate = error(*motions)
    relative = float(estimate.x / abs(case.x0))
    accepted = bool(motions[0].resolved and relative <= ACCEPTED and estimate.columns <= ACCEPTED_COLUMN)
    return motions[0], accepted, relative


def measure(case: cases.Case, rng: np.random.Generator, *, derivatives: bool, rough: float = 0.01) -> dict[str, float]:
    """Return errors of a case and whether its result is accepted."""
    period = 2 * np.pi * float(np.sqrt(case.oscillator.mass / case.oscillator.stiffness))
    ts = np.arange(0.0, (case.half_cycles + 0.2) * period / 2 * 1.05, period / 2 / SAMPLES)
    truth = oracle.decay(case.oscillator, case.free, case.x0, ts, derivatives=derivatives, most=case.half_cycles)
    known = np.isfinite(truth.x)
    points = truth.turning_points * (1 + rough * rng.uniform(-1, 1, truth.turning_points.size))
    with np.errstate(all="ignore"):
        for centre, finer in (("onset", False), ("fastest", False), ("onset", True), ("fastest", True)):
            motion, accepted, estimate = attempt(case, points, ts[known], truth.stopped, centre, finer)
            if accepted:
                break
    columns = 0.0
    if derivatives:
        free = [*range(len(case.free)), motion.columns.shape[1] - 1]
        size = np.max(np.abs(truth.columns[known]), axis=0)
        changes = np.max(np.abs(motion.columns[:, free] - truth.columns[known]), axis=0)
        columns = float(np.max(changes[size > 0] / size[size > 0]))
    return {
        "half-cycles": truth.turning_points.size - 1,
        "accepted": accepted,
        "x": float(np.max(np.abs(motion.x - truth.x[known]))) / abs(case.x0),
        "estimate": estimate,
        "columns": columns,
        "rest": bool(np.all(motion.excess[:-1] > 0) and (not truth.stopped or motion.excess[-1] <= 0)),
        "correction": float(motion.quality.correction),
        "rate": float(motion.quality.phase_rate),
    }


def report(name: str, chosen: Iterable[cases.Case], *, derivatives: bool, each: bool, rough: float = 0.01) -> None:
    """Print the table of a group of cases."""
    rng, began = np.random.default_rng(0), time.time()
    rows = [(case, measure(case, rng, derivatives=derivatives, rough=rough)) for case in chosen if case.half_cycles]
    print(f"{name}: {len(rows)} machines, {time.time() - began:.0f} s")
    bad = []
    for case, row in rows:
        limit = LARGEST_LOOSE if case.loose else LARGEST
        wrong = row["accepted"] and (not row["x"] <= limit or not row["columns"] <= LARGEST_COLUMN or not row["rest"])
        bad += [case] * wrong
        if each or wrong or not row["accepted"]:
            print(
                f"  {case.name:32s} {row['half-cycles']:3.0f} half-cycles {row['x'] * 2e6:9.1e} nm "
                f"(estimate {row['estimate'] * 2e6:8.1e}) columns {row['columns']:8.1e} "
                f"correction {row['correction']:8.1e} rate {row['rate']:5.2f}"
                f"{'' if row['accepted'] else '  not accepted'}{'  WRONG' if wrong else ''}"
            )
    good = [row for _, row in rows if row["accepted"]]
    for what, unit, factor in (("x", "nm on 2 mm", 2e6), ("columns", "of the column", 1.0)):
        values = np.array([row[what] for row in good] or [np.nan]) * factor
        print(f"  accepted {len(good)}: {what} median {np.median(values):.1e}, largest {np.max(values):.1e} {unit}")
    print(f"  accepted above the limits: {len(bad)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("groups", nargs="*", default=["fixed", "random", "grazing"])
    parser.add_argument("--count", type=int, default=None, help="machines in the random groups")
    chosen = parser.parse_args()
    if "fixed" in chosen.groups:
        report("fixed", cases.fixed(), derivatives=True, each=True)
    if "random" in chosen.groups:
        report("random", cases.random(chosen.count or 300), derivatives=True, each=False)
    if "grazing" in chosen.groups:
        report("grazing", cases.grazing(chosen.count or 500), derivatives=False, each=False, rough=0.001)


if __name__ == "__main__":
    main()
