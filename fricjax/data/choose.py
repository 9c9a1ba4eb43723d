"""Which column is the time and which the displacement: by name, by index, or by the names the field uses."""

from collections.abc import Sequence

from .errors import DataError, UsageError, nearest
from .units import si_unit

TIME_NAMES = ("t", "time", "times", "timestamp", "time_s", "zeit", "temps", "sec", "seconds")
DISPLACEMENT_NAMES = (
    "x", "displacement", "position", "pos", "disp", "distance", "theta", "angle", "phi", "y", "q", "weg", "auslenkung",
)  # fmt: skip


def locate(wanted: str | int, names: Sequence[str], source: str, what: str) -> int:
    """Index of the column called or numbered `wanted`; an unknown one is a `DataError` that offers the nearest name."""
    if isinstance(wanted, bool) or not isinstance(wanted, (str, int)):
        raise UsageError(f"{what}= must be a name or an index of a column, but it is {wanted!r}.")
    if isinstance(wanted, int) or (wanted.lstrip("-").isdigit() and wanted not in names):
        index = int(wanted)
        if not -len(names) <= index < len(names):
            raise DataError(f"{source} has {len(names)} columns, but {what}={index} was asked for (the first is 0).")
        return index % len(names)
    lowered = [name.lower() for name in names]
    if wanted in names:
        return list(names).index(wanted)
    if lowered.count(wanted.lower()) == 1:
        return lowered.index(wanted.lower())
    known = ", ".join(f"'{name}'" for name in names)
    raise DataError(
        f"{source} has no column '{wanted}' (asked for with {what}=).{nearest(wanted, names)} It has {known}."
    )


def time_index(names: Sequence[str], units: Sequence[str | None]) -> int | None:
    """Index of the column that is a time by its name or its unit, None where none or several are."""
    by_name = [i for i, name in enumerate(names) if name.lower() in TIME_NAMES]
    if by_name:
        return by_name[0]
    by_unit = [i for i, unit in enumerate(units) if unit and (si_unit(unit) or (0, ""))[1] == "s"]
    return by_unit[0] if len(by_unit) == 1 else None


def displacement_index(names: Sequence[str], candidates: Sequence[int], source: str) -> int:
    """Index of the displacement among `candidates`: the only one, or the one with a usual name.

    Raises:
        DataError: several candidates and no usual name among them.
    """
    if len(candidates) == 1:
        return candidates[0]
    for usual in DISPLACEMENT_NAMES:
        for i in candidates:
            if names[i].lower() == usual:
                return i
    known = ", ".join(f"'{names[i]}'" for i in candidates)
    raise DataError(f"{source} has several columns that could be the displacement ({known}); name one with column=.")
