"""Receptances as analysers export them: a text table of frequency, real part and imaginary part."""

from pathlib import Path

import numpy as np

from ..data.errors import DataError
from ..data.readers.dialect import Dialect, Layout, number, sniff, split
from ..data.units import si_unit

_UNITS = ("Hz", "m/N", "m/N")
_PARTS = ("frequency", "real part", "imaginary part")


def read_frf(path: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read a receptance from a text table.

    Args:
        path: a file whose first three columns are frequency, real and imaginary part; delimiter and header are found,
            and units stand in the header as in ``Re [um/N]``, else they are Hz and m/N.

    Returns:
        Frequencies [Hz], shape (n,), and the complex receptance [m/N], shape (n,).

    Raises:
        DataError: no such file, no such table, or a unit that does not fit.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    except OSError as error:
        raise DataError(f"The file '{path}' cannot be read: {error.strerror}. Check the path.") from error
    layout = sniff(lines, Dialect(), path.name)
    if len(layout.names) < len(_PARTS):
        raise DataError(
            f"{path.name} has {len(layout.names)} column(s); a receptance needs three: frequency, real part, imaginary "
            "part."
        )
    rows = [_row(path, i + 1, line, layout) for i, line in enumerate(lines) if _holds_data(i, line, layout)]
    table = np.array(rows) * [_factor(path, layout, i) for i in range(len(_PARTS))]
    return table[:, 0], table[:, 1] + 1j * table[:, 2]


def _holds_data(i: int, line: str, layout: Layout) -> bool:
    return i >= layout.first_line and bool(line.strip()) and not Dialect().is_comment(line)


def _row(path: Path, place: int, line: str, layout: Layout) -> list[float]:
    """The three numbers of a line."""
    fields = split(line, layout.delimiter)[: len(_PARTS)]
    values = [number(field, layout.decimal) for field in fields]
    if len(values) < len(_PARTS) or any(value is None or not np.isfinite(value) for value in values):
        raise DataError(f"{path.name}, row {place}: {line.strip()[:60]!r} does not hold three numbers; repair the row.")
    return [float(value) for value in values if value is not None]


def _factor(path: Path, layout: Layout, column: int) -> float:
    """What one unit of a column is in SI units."""
    unit, target = layout.units[column], _UNITS[column]
    if unit is None:
        return 1.0
    found, goal = si_unit(unit), si_unit(target)
    if found is None or goal is None or found[1] != goal[1]:
        raise DataError(
            f"{path.name}: the unit '{unit}' does not fit the {_PARTS[column]} of a receptance; use for example "
            f"'{target}'."
        )
    return found[0]
