"""Detection and repair of instrument faults: fringe slips, dropouts, clock faults."""

from collections.abc import Sized

import numpy as np

from ..errors import UsageError, check_type, first_of
from ..numbers import scalar
from ..show import engineering
from .clock import ClockFault, clock_faults
from .dropouts import Dropout, dropouts
from .readers.choice import faults_of
from .readers.header import scale_of
from .record import Record, Step
from .slips import Slip, slips
from .trace import Trace

# Largest relative deviation of an interval from the median interval in an evenly spaced stretch.
_REGULAR = 1e-2
# Share of repeated samples above which they are reported. Fewer shift the times by less than a tenth of an interval
# (root mean square), which a fit does not notice.
_MANY = 1e-2


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
    check_type("record", record, Record, "a Record")
    if fringe is not None and not 0 < scalar("fringe", fringe) < np.inf:
        raise UsageError(f"fringe must be a positive length in m, got {fringe!r}; one is 316.4e-9 or 158.2e-9.")
    steps = _steps(record, fringe)
    if fringe is not None or not steps:
        return steps
    return _slips_among(steps, _clock_faults(record, steps, find_dropouts(record)))


def _steps(record: Record, fringe: float | None) -> list[Slip]:
    """Return the steps in evenly spaced stretches, whatever their cause."""
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


def find_clock_faults(record: Record) -> list[ClockFault]:
    """Find samples at wrong times: repeated or lost samples and clock jumps.

    A fault while the mass hardly moves goes undetected.

    Returns:
        The faults, in order: `index` of the first sample after each, the `shift` of the time from there on [s], and the
        number of repeated samples (`repeats`) before it.

    Examples:
        The logger loses a sample, and all later samples are stamped a tick early:

        >>> import numpy as np
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> lost = fj.Record(record.t[:-1], np.delete(record.x, 700))
        >>> [(fault.index, f"{1e3 * fault.shift:.2f} ms") for fault in fj.data.find_clock_faults(lost)]
        [(700, '0.20 ms')]
    """
    return _clock_faults(record, _steps(record, None), find_dropouts(record))


def _slips_among(steps: list[Slip], clock: list[ClockFault]) -> list[Slip]:
    """Return the steps that the clock does not explain."""
    late = {i for fault in clock for i in range(fault.index - fault.repeats, fault.index + 1)}
    return [step for step in steps if step.index not in late]


def _clock_faults(record: Record, steps: list[Slip], lost: list[Dropout]) -> list[ClockFault]:
    mask = record.mask.copy()
    for each in lost:
        mask[each.start : each.stop] = False
    used = np.flatnonzero(mask)
    places = np.searchsorted(used, [step.index for step in steps])
    faults = clock_faults(record.t[used], record.x[used], places.tolist())
    used = np.append(used, used[-1] + 1)
    return [fault._replace(index=int(used[fault.index])) for fault in faults]


def repair_clock(record: Record) -> Record:
    """Shift samples to their right times, and remove repeated samples.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> record = fj.read(fj.data.example_paths().run)
        >>> lost = fj.Record(record.t[:-1], np.delete(record.x, 700))
        >>> repaired = fj.data.repair_clock(lost)
        >>> print(repaired.log[-1])
        repair_clock(): the clock is wrong by 200 us at 0.14 s; 0 repeated samples removed
        >>> bool(np.allclose(repaired.t, np.delete(record.t, 700)))
        True
    """
    faults = find_clock_faults(record)
    shifts, kept = np.zeros(len(record)), np.ones(len(record), dtype=bool)
    for fault in faults:
        shifts[fault.index :][:1] = fault.shift
        kept[fault.index - fault.repeats : fault.index] = False
    trace = None
    if faults:
        sigma = record.sigma if record.sigma is None or record.sigma.ndim == 0 else record.sigma[kept]
        t = record.t + np.cumsum(shifts)
        trace = Trace(t[kept], record.x[kept], sigma, record.mask[kept])
    effect = f"{_clock_words(record, faults)}; {_count(np.flatnonzero(~kept), 'repeated sample')} removed"
    return record.with_step(Step("repair_clock", {}, effect), trace=trace)


def repair(record: Record, words: str) -> Record:
    """Repair the faults named in a text such as `"dropouts,slips=158.2 nm"`.

    The order of the words does not matter.

    Raises:
        UsageError: an unknown fault, or an empty text; see `faults_of`.
        DataError: a fringe with a unit that does not fit.

    Examples:
        >>> import fricjax as fj
        >>> print(fj.read(fj.data.example_paths().run, repair="slips=158.2 nm").log[-1])
        repair_slips(fringe=1.582e-07): 0 slips taken out
    """
    named = faults_of(words)
    # The step at the end of a dropout is not a slip, and neither is the step of a wrong clock.
    if "dropouts" in named:
        record = mask_dropouts(record)
    if "clock" in named:
        record = repair_clock(record)
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
    steps = _steps(record, None)
    clock = _clock_faults(record, steps, lost)
    if any(fault.shift for fault in clock) or sum(fault.repeats for fault in clock) > _MANY * len(record):
        sentences["clock"] = f"In the record{where} {_clock_words(record, clock)}. Read it with repair='clock'."
    slipped = _slips_among(steps, clock) if record.quantity == "m" else []
    if slipped:
        sentences["slips"] = (
            f"The record{where} steps between two samples as no decay can, by {_slip_words(record, slipped)}: "
            "its counter has slipped. Read it with repair='slips', or with the fringe, repair='slips=158.2 nm'."
        )
    return sentences


def _slip_words(record: Record, faults: list[Slip]) -> str:
    return first_of(f"{engineering(slip.size, record.quantity)} at {record.t[slip.index]:.6g} s" for slip in faults)


def _clock_words(record: Record, faults: list[ClockFault]) -> str:
    """Describe clock faults by their size, time and number."""
    repeats = sum(fault.repeats for fault in faults)
    wrong = first_of(
        f"{engineering(fault.shift, 's')} at {record.t[fault.index]:.6g} s" for fault in faults if fault.shift
    )
    said = [f"the clock is wrong by {wrong}"] if wrong else []
    # Samples that were written twice are part of a clock error; others come from a slow sensor.
    if repeats and not wrong:
        said.append(f"{repeats} samples repeat the previous value while the mass moves, as from a slow sensor")
    return " and ".join(said) or "the clock is right"


def _count(faults: Sized, word: str) -> str:
    return f"{len(faults)} {word}{'' if len(faults) == 1 else 's'}"
