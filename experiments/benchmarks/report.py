"""Measurements as text tables and as a plot."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from comparison import OURS, TARGETS, Row

import fricjax as fj

HEAD = ("Workload", "Ours", "Peer", "Ours [ms]", "Peer [ms]", "Ratio", "At least", "Passes ours / peer")
HEAD += ("Above optimum ours / peer", "Optimum ours / peer", "Peak ours / peer [MB]", "Cold ours / peer [s]")


def pairs(rows: Sequence[Row]) -> list[tuple[Row, Row]]:
    """Pair each row of fricjax with each peer on the same workload."""
    mine = [row for row in rows if row.method in OURS]
    return [(a, b) for a in mine for b in rows if b.workload == a.workload and b.method not in OURS]


def ratios(rows: Sequence[Row]) -> fj.show.Table:
    """Tabulate fricjax against each peer."""
    cells = []
    for a, b in pairs(rows):
        least = TARGETS.get((a.workload, b.method))
        cells.append(
            (
                a.workload,
                a.method,
                b.method,
                f"{1e3 * a.seconds:.4g}",
                f"{1e3 * b.seconds:.4g}",
                f"{b.seconds / a.seconds:.3g}",
                f"{least:g}" if least else "",
                _both(a.passes, b.passes, "{:.1f}"),
                _both(a.excess, b.excess, "{:.3f}"),
                _both(a.reached, b.reached, "{:.0%}"),
                _both(a.peak, b.peak, "{:.0f}"),
                _both(a.cold, b.cold, "{:.1f}"),
            )
        )
    meaning = "Times: warm medians in turns; ratio: time of the peer over ours; solve only: problems built beforehand"
    return fj.show.Table(HEAD, cells, meaning)


def _both(ours: float | None, peer: float | None, form: str) -> str:
    return " / ".join("-" if value is None else form.format(value) for value in (ours, peer))


def long(rows: Sequence[Row]) -> fj.show.Table:
    """Tabulate long records: time, its growth, and memory."""
    cells = []
    for before, row in zip((None, *rows), rows, strict=False):
        growth = f"{row.seconds / before.seconds:.2f}" if before else ""
        told = ("-" if value is None else f"{value:.4g}" for value in (row.peak, row.cold))
        cells.append((row.workload, f"{row.seconds:.3f}", growth, *told))
    return fj.show.Table(("Samples of long", "Warm fit [s]", "Times the one before", "Peak [MB]", "Cold [s]"), cells)


def errors(found: Sequence[tuple[str, str, float]]) -> fj.show.Table:
    """Tabulate numerical errors."""
    cells = [(workload, method, f"{error:.2g}") for workload, method, error in found]
    return fj.show.Table(("Workload", "Engine or peer", "Largest error [nm]"), cells)


def plot(rows: Sequence[Row], path: Path) -> Path:
    """Plot ratios as bars on a logarithmic axis, and mark targets."""
    shown = pairs(rows)[::-1]
    picture, axes = fj.show.figure()
    picture.set_figheight(1.0 + 0.3 * len(shown))
    only = axes[0, 0]
    places = np.arange(len(shown))
    for method, colour, label in zip(OURS, ("#0072B2", "#56B4E9"), ("whole call", "solve only"), strict=True):
        chosen = [(i, b.seconds / a.seconds) for i, (a, b) in enumerate(shown) if a.method == method]
        if chosen:
            only.barh(*zip(*chosen, strict=True), color=colour, label=label)
    marks = [(i, TARGETS.get((a.workload, b.method))) for i, (a, b) in enumerate(shown)]
    asked = [(i, least) for i, least in marks if least]
    only.plot([v for _, v in asked], [i for i, _ in asked], "|", color="#D55E00", markersize=12, label="at least")
    only.set_yticks(places, [f"{a.workload}\nagainst {b.method}" for a, b in shown])
    only.set_xscale("log")
    only.axvline(1.0, color="black", linewidth=0.8)
    only.set_xlabel("Times faster than the peer")
    only.legend(fontsize=8)
    return fj.show.save(picture, path, overwrite=True)
