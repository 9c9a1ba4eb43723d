"""Detection and repair of instrument faults: fringe slips and dropouts."""

import numpy as np

from ..errors import UsageError, first_of
from ..show import engineering
from .dropouts import Dropout, dropouts
from .readers.choice import faults_of
from .readers.header import scale_of
from .record import Record, Step
from .slips import Slip, slips
from .trace import Trace

# Largest relative deviation of an interval from the median interval in an evenly spaced stretch.
_REGULAR = 1e-2


def find_slips(record: Record, fringe: float | None = None) -> list[Slip]:
    """Find fringe counter slips: steps that no smooth decay can make.

    The search treats each evenly spaced stretch without gaps separately. A slip close to a release, a reversal or a
    stop may go undetected.

    Args:
        record: a record.
        fringe: size of one fringe, ``lambda/(2 passes)`` [m]; only steps by whole fringes count then. None: steps of
            any size count.

    Returns:
        The slips, in order: `index` of the first sample after each, its `size` and the `std` of the size [m or rad].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> slipped = fj.Record(record.t, record.x + np.where(np.arange(len(record)) < 1500, 0.0, 158.2e-9))
        >>> [(slip.index, f"{1e9 * slip.size:.1f} nm") for slip in fj.data.find_slips(slipped, fringe=158.2e-9)]
        [(1500, '158.2 nm')]
        >>> fj.data.find_slips(record)
        []
    """
    if fringe is not None and not 0 < fringe < np.inf:
        raise UsageError(f"fringe must be a positive length in m, got {fringe!r}; one is 316.4e-9 or 158.2e-9.")
    t, x, mask = record.t, record.x, record.mask
    intervals = np.diff(t)
    even = np.abs(intervals - np.median(intervals)) < _REGULAR * np.median(intervals)
    together = mask[1:] & mask[:-1] & even
    edges = np.r_[0, np.flatnonzero(~together) + 1, t.size]
    faults: list[Slip] = []
    for start, stop in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        faults += [slip._replace(index=start + slip.index) for slip in slips(x[start:stop], fringe)]
    return faults


def repair_slips(record: Record, fringe: float | None = None) -> Record:
    """Remove the slips of a fringe counter.

    All samples after a slip are shifted back by its size.

    Args:
        record: a record.
        fringe: size of one fringe, ``lambda/(2 passes)`` [m]; the shift is then a whole number of fringes. None: the
            shift is the size estimated from the samples, and its error stays in the record.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> slipped = fj.Record(record.t, record.x + np.where(np.arange(len(record)) < 1500, 0.0, 158.2e-9))
        >>> repaired = fj.data.repair_slips(slipped, fringe=158.2e-9)
        >>> print(repaired.log[-1])
        repair_slips(fringe=1.582e-07): 1 slip taken out: 158 nm at 0.3 s
        >>> float(np.abs(repaired.x - record.x).max()) < 1e-18
        True
    """
    faults = find_slips(record, fringe)
    moved = np.zeros(len(record))
    for slip in faults:
        moved[slip.index :] += slip.size
    trace = Trace(record.t, np.where(record.mask, record.x - moved, record.x), record.sigma, record.mask)
    where = f": {_slip_words(record, faults)}" if faults else ""
    effect = f"{_count(faults, 'slip')} taken out{where}"
    return record.with_step(Step("repair_slips", {"fringe": fringe}, effect), trace=trace if faults else None)


def find_dropouts(record: Record) -> list[Dropout]:
    """Find dropouts: runs of equal samples while the mass moved elsewhere.

    Causes are a lost signal or a converter at the end of its range.

    Returns:
        The dropouts: `start` and `stop` as indices of samples, and the repeated `value` [m or rad].

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> held = record.x.copy()
        >>> held[700:712] = held[700]
        >>> fj.data.find_dropouts(fj.Record(record.t, held))[0][:2], fj.data.find_dropouts(record)
        ((700, 712), [])
    """
    used = np.flatnonzero(record.mask)
    faults = dropouts(record.t[used], record.x[used])
    return [Dropout(int(used[each.start]), int(used[each.stop - 1]) + 1, each.value) for each in faults]


def mask_dropouts(record: Record) -> Record:
    """Mask the samples of dropouts, so that fits ignore them.

    Examples:
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> held = record.x.copy()
        >>> held[700:712] = held[700]
        >>> print(fj.data.mask_dropouts(fj.Record(record.t, held)).log[-1])
        mask_dropouts(): 12 samples in 1 dropout masked: 0.14 s to 0.1422 s
    """
    faults = find_dropouts(record)
    mask = record.mask.copy()
    for each in faults:
        mask[each.start : each.stop] = False
    count = int(record.mask.sum() - mask.sum())
    spans = first_of(f"{record.t[each.start]:.6g} s to {record.t[each.stop - 1]:.6g} s" for each in faults)
    where = f": {spans}" if faults else ""
    step = Step("mask_dropouts", {}, f"{count} samples in {_count(faults, 'dropout')} masked{where}")
    return record.with_step(step, trace=Trace(record.t, record.x, record.sigma, mask) if faults else None)


def repair(record: Record, words: str) -> Record:
    """Repair the faults named in a text such as `"dropouts,slips=158.2 nm"`.

    Raises:
        UsageError: an unknown fault, or an empty text; see `faults_of`.
        DataError: a fringe with a unit that does not fit.

    Examples:
        >>> import fricjax as fj
        >>> print(fj.read(fj.data.example_paths().run, repair="slips=158.2 nm").log[-1])
        repair_slips(fringe=1.582e-07): 0 slips taken out
    """
    named = faults_of(words)
    # Repair dropouts first: the step at the end of a dropout is not a slip.
    if "dropouts" in named:
        record = mask_dropouts(record)
    if "slips" in named:
        size = named["slips"]
        where = f"the fringe of {record.name or 'the record'}"
        fringe = None if size is None else scale_of(None, size, (record.quantity,), where, "repair")[0]
        record = repair_slips(record, fringe)
    return record


def reported_faults(record: Record, where: str = "") -> dict[str, str]:
    """Return a sentence for each kind of fault, keyed by its repair.

    For angles only dropouts are reported: encoders have no fringes, and they step at their marks.

    Args:
        record: a record.
        where: the record, for the sentence: " of run 2".
    """
    sentences = {}
    lost = find_dropouts(record)
    if lost:
        spans = first_of(f"{record.t[each.start]:.6g} s" for each in lost)
        sentences["dropouts"] = (
            f"The record{where} repeats one value where the mass was elsewhere, at {spans}: its signal was lost or "
            "left the range. Read it with repair='dropouts'."
        )
    slipped = find_slips(record) if record.quantity == "m" else []
    if slipped:
        sentences["slips"] = (
            f"The record{where} steps between two samples as no decay can, by {_slip_words(record, slipped)}: "
            "its counter has slipped. Read it with repair='slips', or with the fringe, repair='slips=158.2 nm'."
        )
    return sentences


def _slip_words(record: Record, faults: list[Slip]) -> str:
    return first_of(f"{engineering(slip.size, record.quantity)} at {record.t[slip.index]:.6g} s" for slip in faults)


def _count(faults: list[Slip] | list[Dropout], word: str) -> str:
    return f"{len(faults)} {word}{'' if len(faults) == 1 else 's'}"
