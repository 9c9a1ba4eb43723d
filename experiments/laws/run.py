"""Accuracy and speed of every law against SciPy.

For each law: the error of `fj.simulate` against an independent reference, its time once compiled, and the time of the
fastest of several ways to integrate the same law with SciPy, each at the loosest tolerance that keeps to 0.1 nm. The
right-hand sides for SciPy are plain Python numbers.

    python experiments/laws/run.py [--only Dahl LuGre] [--json out.json] [--quick]
"""

import argparse
import contextlib
import json
import signal
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402
from experiments.laws.workloads import X0, Peer, Workload, workloads  # noqa: E402

# What is asked for: error [nm], and time of SciPy over ours.
ERROR, RATIO = 0.1, 20.0
# The search for the tolerance of one way of SciPy may take five times this [s], or the time of the best way so far.
PATIENCE = 10.0
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
HEADS = ("law", "motion", "engine", "error [nm]", "time [ms]", "SciPy", "rtol", "error [nm]", "time [ms]", "ratio", "")


class Peered(NamedTuple):
    """What one way needed: its name, tolerance, error [nm] and time [s]."""

    name: str
    rtol: float
    error: float
    seconds: float


class Row(NamedTuple):
    """One law: errors [nm], times [ms], and the time of SciPy over ours."""

    law: str
    motion: str
    engine: str
    error: float
    time: float
    scipy: str
    rtol: float
    scipy_error: float
    scipy_time: float

    @property
    def ratio(self) -> float:
        return self.scipy_time / self.time

    @property
    def holds(self) -> bool:
        return self.error <= ERROR and self.ratio >= RATIO


def seconds(job: Callable[[], object], repeats: int) -> float:
    """Median time of one call."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        job()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)


def nanometres(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(found - expected))) * 1e9


def loosest(peer: Peer, ts: np.ndarray, expected: np.ndarray, limit: float) -> Peered | None:
    """The loosest tolerance that keeps to the error; nothing where none does, or not in five times `limit` [s]."""
    try:
        # A tolerance that is too loose may run away.
        with alarm(5 * limit), np.errstate(all="ignore"):
            for rtol in TOLERANCES:
                begin = time.perf_counter()
                error = nanometres(peer.solve(ts, rtol), expected)
                if error <= ERROR:
                    return Peered(peer.name, rtol, error, time.perf_counter() - begin)
    except (TimeoutError, OverflowError, RuntimeError):
        return None
    return None


@contextlib.contextmanager
def alarm(limit: float) -> Iterator[None]:
    """Leave the block with a TimeoutError after that time [s]."""

    def ring(_signal: int, _frame: object) -> None:
        raise TimeoutError

    signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def fastest(work: Workload, ts: np.ndarray, expected: np.ndarray, repeats: int) -> Peered:
    """The fastest way of SciPy to 0.1 nm; the reference itself where none keeps to it in time."""
    best, solve = None, None
    for peer in work.peers:
        found = loosest(peer, ts, expected, best.seconds if best else PATIENCE)
        if found is not None and (best is None or found.seconds < best.seconds):
            best, solve = found, peer.solve
    if best is None or solve is None:
        return Peered("reference", TOLERANCES[-1], 0.0, seconds(lambda: work.reference(ts), 1))
    return best._replace(seconds=seconds(lambda: solve(ts, best.rtol), repeats))


def measure(work: Workload, quick: bool) -> Row:
    ts, machine = work.run.times(quick), fj.Oscillator(*work.run.machine, work.friction)
    repeats = 1 if quick else 5
    expected = work.reference(ts)
    motion = fj.simulate(machine, X0, ts)
    ours = seconds(lambda: jax.block_until_ready(fj.simulate(machine, X0, ts).x), 5 * repeats)
    peer = fastest(work, ts, expected, repeats)
    error = nanometres(np.asarray(motion.x), expected)
    names = (work.law, work.run.name, motion.engine)
    return Row(*names, error, 1e3 * ours, peer.name, peer.rtol, peer.error, 1e3 * peer.seconds)


def cells(row: Row) -> tuple[str, ...]:
    return (
        row.law, row.motion, row.engine, f"{row.error:.4f}", f"{row.time:.2f}", row.scipy, f"{row.rtol:.0e}",
        f"{row.scipy_error:.4f}", f"{row.scipy_time:.1f}", f"{row.ratio:.0f}", "holds" if row.holds else "MISSED",
    )  # fmt: skip


def show(row: Sequence[str]) -> None:
    widths = (23, 8, 7, 10, 10, 23, 6, 10, 10, 6, 6)
    print("  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip(), flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="LAW", help="names of laws")
    parser.add_argument("--json", type=Path, help="write the rows to this file")
    parser.add_argument("--quick", action="store_true", help="an eighth of the motion, one repetition")
    options = parser.parse_args()
    chosen = [work for work in workloads() if not options.only or work.law.split(",")[0] in options.only]
    show(HEADS)
    rows = []
    for work in chosen:
        rows.append(measure(work, options.quick))
        show(cells(rows[-1]))
    print(f"\nAsked for: error at most {ERROR} nm, and SciPy at least {RATIO:g} times slower.")
    if options.json:
        told = [{**row._asdict(), "ratio": row.ratio, "holds": row.holds} for row in rows]
        options.json.write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
