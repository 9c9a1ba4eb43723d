"""Summary of all runs: counts, control limits, reasons of failure."""

import re
from collections import Counter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..archive.show import unit_of
from ..archive.table import STATUSES
from ..errors import DataError, first_of
from ..fitting.names import of_run
from ..fitting.population import population
from ..show import Report, Table, uncertain
from .columns import COMBINED, STD, numbers, parameters, typical_unit

if TYPE_CHECKING:
    from pandas import DataFrame

# Shewhart's control limits: three of a thousand equivalent runs lie outside.
_SIGMAS = 3.0
# Coefficients without a common mean for runs under several loads.
_FOLLOW_THE_LOAD = ("dead_band", "friction_deceleration")
# Parts that differ between two sentences about the same fault: quoted words, paths, numbers.
_PARTICULAR = re.compile(r"'[^']*'|\"[^\"]*\"|\S*[/\\]\S+|(?<![\w.])[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?(?![\w])")


class Limits(NamedTuple):
    """Control limits of a coefficient under one law.

    They are in the unit of its column.

    Attributes:
        name: name of the coefficient.
        law: friction law of the runs.
        mean, low, high: mean, and the limits three standard deviations below and above it.
        sentence: explanation of the limits.
    """

    name: str
    law: str
    mean: float
    low: float
    high: float
    sentence: str


def summary(frame: "DataFrame", quantity: str) -> tuple[Report, list[Limits]]:
    """Summarise a table of runs; return the report and the control limits."""
    counts = Counter(frame["status"])
    laws = sorted(set(frame["friction"].dropna())) if "friction" in frame else [""]
    rows, limits = [], []
    for law in laws:
        chosen: Any = frame[(frame["status"] == "ok") & ((frame["friction"] == law) if law else True)]
        loads = numbers(chosen, "load")
        several_loads = np.unique(loads[np.isfinite(loads)]).size > 1
        for name in parameters(frame):
            if of_run(name) or (several_loads and name in _FOLLOW_THE_LOAD):
                continue
            row, limit = _population(chosen, name, law, unit_of(name, laws, quantity))
            rows += row
            limits += limit
    head = ["Coefficient", "Law", "Mean (combined uncertainty)", "Scatter from run to run", "Runs", "Set aside"]
    present = [status for status in (*STATUSES, *sorted(set(counts) - {*STATUSES})) if counts[status]]
    facts = [("runs", f"{len(frame):,}: " + ", ".join(f"{counts[status]:,} {status}" for status in present))]
    facts += [(name, text) for name in ("friction", "rig", "engine", "fricjax") if (text := _different(frame, name))]
    if instants := sorted(frame["measured_at"].dropna().astype(str)) if "measured_at" in frame else []:
        facts.append(("measured", f"{instants[0][:16]} to {instants[-1][:16]}".replace("T", " ")))
    return Report([Table(head, rows)], facts, heading="Archive"), limits


def _population(frame: "DataFrame", name: str, law: str, unit: str) -> tuple[list[list[str]], list[Limits]]:
    """Row and control limits of a coefficient; empty for too few runs."""
    values, std = numbers(frame, name), numbers(frame, f"{name}{STD}")
    combined = numbers(frame, f"{name}{COMBINED}")
    # The uncertainty from the inputs of the rig is common to all runs, so the mean does not reduce it.
    common = np.sqrt(np.maximum(combined**2 - std**2, 0.0))
    factor, shown = typical_unit(values, unit)
    try:
        pooled = population(factor * values, factor * std, [np.nan_to_num(factor * common)])
    except DataError:
        return [], []
    noise = float(np.median(factor * std[np.isfinite(std) & (std > 0)]))
    reach = _SIGMAS * float(np.hypot(pooled.scatter, noise))
    aside = f", {len(pooled.outliers)} set aside" if pooled.outliers else ""
    mean = uncertain(pooled.mean, pooled.combined_std, shown)
    scatter = f"{float(f'{pooled.scatter:.2g}'):g} {shown}".strip()
    sentence = (
        f"Lines: mean {uncertain(pooled.mean, pooled.std, shown)} of {pooled.runs:,} ok runs{aside}, and three "
        f"standard deviations on either side: scatter from run to run {scatter} with the typical standard "
        f"error {noise:.2g} {shown}".rstrip()
        + "."
    )
    row = [name, law, mean, scatter, f"{pooled.runs:,}", str(len(pooled.outliers) or "")]
    return [row], [Limits(name, law, pooled.mean, pooled.mean - reach, pooled.mean + reach, sentence)]


def _different(frame: "DataFrame", name: str) -> str:
    """List the most frequent texts of a column."""
    if name not in frame:
        return ""
    words = [str(word) for word in frame[name].dropna().value_counts().index if word != ""]
    return first_of(words, 4)


def reasons(frame: "DataFrame") -> tuple[list[dict[str, Any]], np.ndarray]:
    """Group the failed runs by reason, the largest group first.

    Returns:
        For each group its `status`, its `reason` (a sentence in which dots replace the parts that differ from run to
        run) and the number of its `runs`. For each row of the table the index of its group, -1 if the run is ok.
    """
    outcomes = frame["outcome"] if "outcome" in frame else [None] * len(frame)
    rows = zip(frame["status"], outcomes, frame["file"], strict=True)
    of_rows = [None if status == "ok" else (status, _reason(status, text, file)) for status, text, file in rows]
    groups = Counter(each for each in of_rows if each is not None).most_common()
    number = {group: i for i, (group, _) in enumerate(groups)}
    listed = [{"status": status, "reason": reason, "runs": count} for (status, reason), count in groups]
    return listed, np.array([-1 if each is None else number[each] for each in of_rows], dtype=int)


def _reason(status: str, outcome: object, file: object) -> str:
    """Remove the parts of a sentence that are specific to one run.

    For an invalid fit, keep the text before the numbers.
    """
    if not isinstance(outcome, str):
        return ""
    if status == "invalid":
        return outcome.partition(":")[0]
    name = str(file)
    for particular in (name, name.rpartition("/")[2]):
        outcome = outcome.replace(particular, "…") if particular else outcome
    return _PARTICULAR.sub("…", outcome)
