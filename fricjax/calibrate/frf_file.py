"""Receptances as analysers export them: a text table of frequency, real part and imaginary part."""

from pathlib import Path

import numpy as np

from ..data.table import read_table

_COLUMNS = {"frequency": "Hz", "real part": "m/N", "imaginary part": "m/N"}


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
    frequency, real, imaginary = read_table(path, _COLUMNS, what="a receptance").values()
    return frequency, real + 1j * imaginary
