"""Accuracy and speed of every law against SciPy.

For each law the table gives the error of `fj.simulate` against an independent reference, its time once compiled, and
the time of the faster of SciPy's odeint and Radau on the same law, each at the loosest tolerance that keeps 0.1 nm.
These two cannot integrate laws that hold the mass by a jump. For such laws the integration restarts at each reversal.
The last columns give, for information, the fastest method that uses more than the equation of the law: restarts at the
reversals, or a closed form between two switches. The right-hand sides for SciPy are in plain Python numbers.

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
from functools import partial
from pathlib import Path
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)
sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402
from experiments.laws.workloads import X0, Peer, Workload, workloads  # noqa: E402

# Requirements: largest error [nm], and smallest ratio of SciPy's time to ours.
ERROR, RATIO = 0.1, 20.0
# Shortest time of a turn [s]. The first call after another job finds the caches cold.
TURN = 0.02
# The search for a tolerance may take five times this [s], or five times the best method so far.
PATIENCE = 10.0
TOLERANCES = (1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12)
HEADS = ("law", "motion", "engine", "error [nm]", "time [ms]", "SciPy", "rtol", "error [nm]", "time [ms]", "ratio", "")
HEADS += ("knowing more", "time [ms]", "ratio")


class Peered(NamedTuple):
    """A SciPy method at its tolerance.

    Attributes:
        name: name of the method.
        rtol: loosest sufficient relative tolerance.
        error: error at this tolerance [nm].
        solve: function that runs the method.
    """

    name: str
    rtol: float
    error: float
    solve: Callable[[], object]


class Row(NamedTuple):
    """Results of one law: errors [nm], times [ms], names of methods."""

    law: str
    motion: str
    engine: str
    error: float
    time: float
    scipy: str
    rtol: float
    scipy_error: float
    scipy_time: float
    other: str | None
    other_time: float | None

    @property
    def ratio(self) -> float:
        return self.scipy_time / self.time

    @property
    def other_ratio(self) -> float | None:
        return self.other_time and self.other_time / self.time

    @property
    def holds(self) -> bool:
        return self.error <= ERROR and self.ratio >= RATIO


def in_turns(jobs: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Return the median time of one call of each job [ms].

    Jobs run in turns, because the speed of a machine varies. A turn of a short job has several calls.
    """
    times: list[list[float]] = [[] for _ in jobs]
    for _ in range(repeats):
        for job, taken in zip(jobs, times, strict=True):
            end = time.perf_counter() + TURN
            while not taken or time.perf_counter() < end:
                begin = time.perf_counter()
                job()
                taken.append(time.perf_counter() - begin)
    return [1e3 * statistics.median(taken) for taken in times]


def nanometres(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(found - expected))) * 1e9


def loosest(peer: Peer, ts: np.ndarray, expected: np.ndarray, limit: float) -> tuple[Peered, float] | None:
    """Find the loosest sufficient tolerance and its time [s].

    Returns None if no tolerance keeps the error limit within five times `limit` [s].
    """
    try:
        # The solution may diverge if the tolerance is too loose.
        with alarm(5 * limit), np.errstate(all="ignore"):
            for rtol in TOLERANCES:
                begin = time.perf_counter()
                error = nanometres(peer.solve(ts, rtol), expected)
                if error <= ERROR:
                    return Peered(peer.name, rtol, error, partial(peer.solve, ts, rtol)), time.perf_counter() - begin
    except (TimeoutError, OverflowError, RuntimeError):
        return None
    return None


@contextlib.contextmanager
def alarm(limit: float) -> Iterator[None]:
    """Leave the block with a TimeoutError after `limit` [s]."""

    def ring(_signal: int, _frame: object) -> None:
        raise TimeoutError

    signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def fastest(peers: Sequence[Peer], ts: np.ndarray, expected: np.ndarray) -> Peered | None:
    """Find the fastest method that keeps 0.1 nm, or None."""
    best, least = None, PATIENCE
    for peer in peers:
        found = loosest(peer, ts, expected, least)
        if found is not None and (best is None or found[1] < least):
            best, least = found
    return best


def measure(work: Workload, quick: bool) -> Row:
    ts, machine = work.run.times(quick), fj.Oscillator(*work.run.machine, work.friction)
    expected = work.reference(ts)
    motion = fj.simulate(machine, X0, ts)
    error = nanometres(np.asarray(motion.x), expected)
    peer = fastest(work.peers, ts, expected) or Peered("reference", TOLERANCES[-1], 0.0, partial(work.reference, ts))
    other = fastest(work.others, ts, expected)
    ways = [way.solve for way in (peer, other) if way]
    ours, *theirs = in_turns([lambda: jax.block_until_ready(fj.simulate(machine, X0, ts).x), *ways], 1 if quick else 5)
    found = (peer.name, peer.rtol, peer.error, theirs[0])
    more = (other.name, theirs[1]) if other else (None, None)
    return Row(work.law, work.run.name, motion.engine, error, ours, *found, *more)


def cells(row: Row) -> tuple[str, ...]:
    return (
        row.law, row.motion, row.engine, f"{row.error:.4f}", f"{row.time:.2f}", row.scipy, f"{row.rtol:.0e}",
        f"{row.scipy_error:.4f}", f"{row.scipy_time:.1f}", f"{row.ratio:.0f}", "holds" if row.holds else "MISSED",
        *((row.other, f"{row.other_time:.1f}", f"{row.other_ratio:.1f}") if row.other else ("", "", "")),
    )  # fmt: skip


def show(row: Sequence[str]) -> None:
    widths = (23, 8, 7, 10, 10, 22, 6, 10, 10, 6, 6, 21, 10, 6)
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
    held = {row.law for row in rows if row.holds}
    missed = dict.fromkeys(row.law for row in rows if row.law not in held)
    print(f"\nRequired: error at most {ERROR} nm, and SciPy at least {RATIO:g} times slower, on one of the motions.")
    print(f"Met by {len(held)} of {len(held) + len(missed)}; not by: {'; '.join(missed) or 'none'}.")
    if options.json:
        derived = ("ratio", "other_ratio", "holds")
        told = [row._asdict() | {name: getattr(row, name) for name in derived} for row in rows]
        options.json.write_text(json.dumps(told, indent=1))


if __name__ == "__main__":
    main()
