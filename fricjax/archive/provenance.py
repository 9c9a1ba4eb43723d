"""The key of a run, and its residuals as a file that says what they are of."""

import hashlib
import io
from collections.abc import Mapping
from typing import Any

from ..errors import needed
from .study import SCHEMA


def row_key(sha256: str, settings: str, run: str) -> str:
    """What a run is known by: the bytes of its file, its name there, and what it was fitted with."""
    return hashlib.sha256("\0".join((SCHEMA, sha256, settings, run)).encode()).hexdigest()


def netcdf(row: Mapping[str, Any], samples: Any) -> bytes:
    """Times, displacements and residuals of a run as netCDF-4.

    Args:
        row: its row of the table, of which the attributes are made.
        samples: a sketch of all its samples.

    Raises:
        UsageError: a package is not installed.
    """
    xarray, _ = (needed("A file of residuals", module, "batch") for module in ("xarray", "h5netcdf"))
    unit = row["quantity"]
    named = {
        "x": (samples.x, "displacement about the equilibrium"),
        "residual": (samples.residual, "measured minus model"),
    }
    variables = {name: ("t", values, {"units": unit, "long_name": words}) for name, (values, words) in named.items()}
    times = {"t": ("t", samples.t, {"units": "s", "long_name": "time from the first sample"})}
    kept = ("key", "file", "run", "friction", "status", "sha256", "fricjax")
    attributes = {"Conventions": "CF-1.11", **{name: str(row[name]) for name in kept}}
    buffer = io.BytesIO()
    xarray.Dataset(variables, times, attributes).to_netcdf(buffer, engine="h5netcdf")
    return buffer.getvalue()
