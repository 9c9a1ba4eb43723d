"""What a page says of all runs at once: control limits, reasons of failure, and the counts above the table."""

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

# Shewhart's: of runs that are alike three of a thousand lie beyond.
_SIGMAS = 3.0
# Of runs under several loads these have no mean.
_FOLLOW_THE_LOAD = ("dead_band", "friction_deceleration")
# What differs between two sentences about the same fault: quoted words, paths, numbers.
_PARTICULAR = re.compile(r"'[^']*'|\"[^\"]*\"|\S*[/\\]\S+|(?<![\w.])[-+]?\d[\d.,]*(?:[eE][-+]?\d+)?(?![\w])")


class Limits(NamedTuple):
    """The control chart of a coefficient under one law, in the unit of its column.

    Attributes:
        name: of the coefficient; `law`: the friction law of the runs.
        mean, low, high: the centre, and three standard deviations on either side of it.
        sentence: where they come from.
    """

    name: str
    law: str
    mean: float
    low: float
    high: float
    sentence: str


def summary(frame: "DataFrame", quantity: str) -> tuple[Report, list[Limits]]:
    """Counts and populations of a table of runs, and the control limits that follow from the latter."""
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
    """A row of the table of coefficients and the control limits; nothing where fewer than three runs tell."""
    values, std = numbers(frame, name), numbers(frame, f"{name}{STD}")
    combined = numbers(frame, f"{name}{COMBINED}")
    # What the inputs of the rig make uncertain is common to all runs: no mean takes it away.
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
    """The different texts of a column, the most frequent first; of many only some."""
    if name not in frame:
        return ""
    words = [str(word) for word in frame[name].dropna().value_counts().index if word != ""]
    return first_of(words, 4)


def reasons(frame: "DataFrame") -> tuple[list[dict[str, Any]], np.ndarray]:
    """The runs that are not ok, in groups of one reason each, the largest first.

    Returns:
        For each group its `status`, its `reason` (a sentence in which dots stand for what differs from run to run) and
        the number of its `runs`; and for each row of the table the number of its group, -1 where it is ok.
    """
    outcomes = frame["outcome"] if "outcome" in frame else [None] * len(frame)
    rows = zip(frame["status"], outcomes, frame["file"], strict=True)
    of_rows = [None if status == "ok" else (status, _reason(status, text, file)) for status, text, file in rows]
    groups = Counter(each for each in of_rows if each is not None).most_common()
    number = {group: i for i, (group, _) in enumerate(groups)}
    listed = [{"status": status, "reason": reason, "runs": count} for (status, reason), count in groups]
    return listed, np.array([-1 if each is None else number[each] for each in of_rows], dtype=int)


def _reason(status: str, outcome: object, file: object) -> str:
    """A sentence without what is its run's alone; of an invalid fit the name before the figures."""
    if not isinstance(outcome, str):
        return ""
    if status == "invalid":
        return outcome.partition(":")[0]
    name = str(file)
    for particular in (name, name.rpartition("/")[2]):
        outcome = outcome.replace(particular, "…") if particular else outcome
    return _PARTICULAR.sub("…", outcome)
