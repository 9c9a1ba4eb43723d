"""Compare fricjax with its peers on each workload.

The methods run in turns. The comparison covers time, model solves, optimum and memory.
"""

import dataclasses
from collections.abc import Iterator
from pathlib import Path

import jobs
import measure
import numpy as np
import workloads
from peers.least_squares import Outcome
from peers.pool import Pool
from record import Record, save

# Required ratio of the peer's time to ours.
TARGETS = {
    ("rolling", "numba RK4"): 12.0,
    ("rolling", "stock optimistix"): 15.0,
    ("rolling-exact", "numba closed form"): 2.0,
    ("rolling-lugre", "CVODES"): 22.0,
    ("rolling-lugre", "odeint"): 22.0,
    ("archive (Coulomb)", "numba closed form"): 3.0,
    ("archive (Coulomb)", "numba closed form, own Jacobian"): 0.7,
    ("archive (Tanh)", "numba RK4"): 16.0,
    ("archive (Tanh)", "stock optimistix"): 120.0,
    ("archive (Tanh)", "stock optimistix, one by one"): 12.0,
    ("map", "DOP853"): 1e4,
    ("sliding", "DOP853"): 40.0,
}
OURS = ("fricjax", "fricjax, solve only")
CLOSED = ("numba closed form", "numba closed form, own Jacobian")
FITS = {
    "rolling": ("tanh", (*OURS, "numba RK4", "CVODES", "odeint", "stock optimistix")),
    "rolling-exact": ("coulomb", (*OURS, *CLOSED)),
    "rolling-lugre": ("lugre", (*OURS, "CVODES", "odeint")),
    "archive (Coulomb)": ("coulomb", (*OURS, *CLOSED)),
    "archive (Tanh)": ("tanh", (*OURS, "numba RK4", "stock optimistix", "stock optimistix, one by one")),
}
FORWARD = ("map", "sliding")
# A fit reaches the optimum if its chi^2 is at most this far above the lowest of all methods.
OPTIMUM = 0.1


@dataclasses.dataclass(frozen=True)
class Scale:
    """Sizes of all workloads.

    Attributes:
        duration: duration of the records [s].
        runs, stock_runs: number of runs of an archive, and number of them for the stock peers.
        displacements, event_displacements: number of releases of the map, and number of them for the event-driven peer.
        samples: numbers of samples of the long records.
        repeats: rounds of timing.
        fresh: measure cold times and memory, each in a new process.
    """

    duration: float = 2.0
    runs: int = 1000
    stock_runs: int = 100
    displacements: int = 100_000
    event_displacements: int = 100
    samples: tuple[int, ...] = (10**6, 10**7)
    repeats: int = 11
    fresh: bool = True


QUICK = Scale(
    0.5, runs=4, stock_runs=2, displacements=1000, event_displacements=5, samples=(10**5,), repeats=1, fresh=False
)


@dataclasses.dataclass(frozen=True)
class Row:
    """Results of one method on one workload.

    Attributes:
        seconds: median warm time, scaled to the whole workload.
        passes: model solves of a fit, mean over runs; for fricjax passes over model and Jacobian.
        excess: chi^2 minus the lowest chi^2 of all methods, largest over runs.
        reached: share of the runs that reach the optimum.
        peak: memory [MB]; None if not measured.
        cold: time from process start to first result [s]; None if not measured.
    """

    workload: str
    method: str
    seconds: float
    passes: float | None = None
    excess: float | None = None
    reached: float | None = None
    peak: float | None = None
    cold: float | None = None


def compare(workload: str, scale: Scale, folder: Path) -> list[Row]:
    """Run all methods on one workload."""
    rows = forward(workload, scale) if workload in FORWARD else fits(workload, scale, folder)
    return list(rows)


def fits(workload: str, scale: Scale, folder: Path) -> Iterator[Row]:
    """Fit one record or an archive by all methods."""
    law, methods = FITS[workload]
    records = _records(workload, law, scale)
    few = records[: scale.stock_runs]
    given = {name: few if name.startswith("stock") else records for name in methods}
    files = {name: save(given[name], folder / f"{law}-{len(given[name])}.npz") for name in methods}
    todo = {name: jobs.fits(name, files[name]) for name in methods}
    timed = measure.race(todo, scale.repeats)
    for pool in todo.values():
        if isinstance(pool, Pool):
            pool.close()
    chi2 = {name: _chi2(given[name], timed[name].result) for name in methods}
    for name in methods:
        n = len(given[name])
        excess = chi2[name] - np.min([found[:n] for found in chi2.values() if found.size >= n], axis=0)
        fresh = measure.fresh(workload, name, files[name]) if scale.fresh else None
        yield Row(
            workload,
            name,
            timed[name].seconds * len(records) / n,
            passes=float(np.mean([outcome.solves for outcome in timed[name].result])),
            excess=float(np.max(excess)),
            reached=float(np.mean(excess <= OPTIMUM)),
            peak=fresh and fresh.peak,
            cold=fresh and fresh.cold,
        )


def _records(workload: str, law: str, scale: Scale) -> list[Record]:
    if workload.startswith("archive"):
        return workloads.archive(law, scale.runs, duration=scale.duration)
    return [workloads.record(law, duration=scale.duration)]


def _chi2(records: list[Record], found: list[Outcome]) -> np.ndarray:
    """Evaluate chi^2 by the reference solution; infinite for fits without a number."""
    judged = [workloads.chi2(record, outcome.values) for record, outcome in zip(records, found, strict=True)]
    return np.nan_to_num(np.array(judged), nan=np.inf)


def forward(workload: str, scale: Scale) -> Iterator[Row]:
    """Simulate the map of final displacements or one `sliding` motion."""
    counts = {"fricjax": scale.displacements, "DOP853": scale.event_displacements}
    timed = measure.race({name: jobs.displacements(workload, name, n) for name, n in counts.items()}, scale.repeats)
    for name, n in counts.items():
        share = scale.displacements / n if workload == "map" else 1.0
        fresh = measure.fresh(workload, name, str(n)) if scale.fresh else None
        yield Row(workload, name, timed[name].seconds * share, peak=fresh and fresh.peak, cold=fresh and fresh.cold)


def long(scale: Scale, folder: Path) -> list[Row]:
    """Fit records of the same motion with more and more samples."""
    rows = []
    for n in scale.samples:
        record = workloads.record("coulomb", rate=n / scale.duration, duration=scale.duration)
        file = save([record], folder / f"long-{n}.npz")
        if scale.fresh:
            alone = measure.fresh("long", "fricjax", file, calls=4)
            rows.append(Row(f"{n:.0e}", "fricjax", float(np.median(alone.warm)), peak=alone.peak, cold=alone.cold))
        else:
            timed = measure.race({"fricjax": jobs.fits("fricjax", file)}, 1)["fricjax"]
            rows.append(Row(f"{n:.0e}", "fricjax", timed.seconds, passes=timed.result[0].solves))
    return rows
