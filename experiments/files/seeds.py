"""One intact file of every format that fricjax reads.

The files are small, so that a random change often hits an important byte.
"""

import dataclasses
import json
import typing
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io

from fricjax import Fit, Measured, Oscillator, Record, Trace
from fricjax.data import write
from fricjax.fitting.noise import Noise, Whiteness
from fricjax.fitting.residual import Run
from fricjax.fitting.rest import Margin
from fricjax.friction import Coulomb
from fricjax.oscillator import Exact

N = 40
T = np.arange(N) / 2000
X = 1e-3 * np.cos(2 * np.pi * 12.6 * T) * np.exp(-5 * T)
RIG = """# a rig
mass = { value = 410.7, std = 0.3, unit = "g" }
frequency = "12.600(2) Hz"
normal_force = { value = 9.66, std = "0.5 %" }
damping = 0.17
displacement_scale = "1 +/- 2e-6"
restoring = "linear"
"""


def record() -> Record:
    meta = {"source": "run.csv", "format": "csv", "quantity": "m", "release_time": 0.001}
    return Record(Trace(T, X, 1e-9), meta)


def fit() -> Fit:
    """Build a fit of a short record without fitting."""
    numbers = {"mu": 0.05, "x0": 1e-3}
    stds = {"mu": 1e-5, "x0": 1e-9}
    given: dict[str, Any] = {
        "names": ("mu", "x0"),
        **dict.fromkeys(("std_errors", "white_std_errors", "combined_std_errors"), stds),
        "values": numbers,
        "intervals": {"mu": (0.04998, 0.05002), "x0": (9.9e-4, 1.01e-3), "mu_s": (0.05, 0.12)},
        **dict.fromkeys(("covariance", "combined_covariance"), np.diag([1e-10, 1e-18])),
        "units": {"mu": "", "x0": "m"},
        "flags": {"mu": (), "x0": ("at bound",)},
        "status": "converged",
        "warnings": ("A sentence.",),
        "kinematics": {"natural_frequency": Measured(12.6, 1e-4, "Hz"), "dead_band": Measured(1e-4, 1e-8, "m")},
        "inputs": {"mass": Measured(0.41, 1e-4)},
        "contributions": {"mu": {"mass": 1e-6}, "x0": {}, "natural_frequency": {}, "dead_band": {}},
        "residuals": np.where(T > 0.001, 1e-9, np.nan),
        "noises": (Noise(lines=()),),
        "whiteness": Whiteness(0.01, 1.0, True),
        "margins": (Margin(1e-4, 2e-4),),
        "half_cycles": (4,),
        "oscillator": Oscillator(0.41, 2574.0, 0.17, 9.66, Coulomb(0.05)),
        "quantity": "m",
        "times": (T,),
        "runs": (Run(T, X, np.full(N, 1e9), np.asarray(4), {"x0": np.asarray(1e-3), "v0": np.asarray(0.0)}),),
        "origins": (0.0,),
        "sources": ("run.csv",),
        "engine_used": Exact(16),
    }
    plain = {bool: True, int: 3, float: 0.5, str: "text"}
    hints = typing.get_type_hints(Fit)
    return Fit(**{f.name: given.get(f.name, plain.get(hints[f.name])) for f in dataclasses.fields(Fit)})


def _text(path: Path, delimiter: str = ",", head: str = "Time [s],Displacement [um]") -> None:
    rows = [delimiter.join(map(repr, pair)) for pair in zip(T.tolist(), (1e6 * X).tolist(), strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n")


def _hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name in ("run1", "run2"):
            group = file.create_group(name)
            group.create_dataset("t", data=T, chunks=(16,), compression="gzip", shuffle=True, fletcher32=True)
            group.create_dataset("x", data=1e6 * X)
            group["x"].attrs.update({"units": "um", "scale_factor": 1.0, "_FillValue": np.float64(-9999)})
        del file["run2/x"]


def _netcdf(path: Path) -> None:
    with h5py.File(path, "w", libver="latest") as file:
        file.create_dataset("time", data=T, chunks=(10,), maxshape=(None,), compression="lzf").attrs["units"] = "s"
        file["x"] = X
        file["time"].make_scale("time")
        file["x"].dims[0].attach_scale(file["time"])


def _tree() -> dict[str, Any]:
    cells = np.empty((2, 1), dtype=object)
    cells[:, 0] = [X[:20], X[20:]]
    return {"t": T[:, None], "x": X[:, None], "cells": cells, "run": {"x": X, "name": "a run"}, "label": "text"}


def _matlab73(path: Path) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        heap = file.create_group("#refs#")
        for name, value in {"t": T, "x": X}.items():
            file.create_dataset(name, data=value[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
        parts = [heap.create_dataset(f"r{i}", data=part[None, :]).ref for i, part in enumerate((X[:20], X[20:]))]
        file.create_dataset("cells", data=np.array([parts], dtype=h5py.ref_dtype), dtype=h5py.ref_dtype)
        file["cells"].attrs["MATLAB_class"] = np.bytes_("cell")
        file.create_dataset("label", data=np.array([[97], [98]], np.uint16)).attrs["MATLAB_class"] = np.bytes_("char")
        file.create_group("run").attrs["MATLAB_class"] = np.bytes_("struct")
        file.create_dataset("run/x", data=X[None, :])
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


PAIRS = list(zip(range(N), map(float, X), strict=True))
GERMAN = [(t, str(x).replace(".", ",")) for t, x in PAIRS]


def _logger(path: Path) -> None:
    """Write times of day, words in each row, and column units."""
    rows = (f"2024-03-05 14:23:{i:02}.5,{x},ok\n" for i, x in PAIRS)
    path.write_text("Logger 5\n\nTime,x [mm],state\n" + "".join(rows))


def _workbook(path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book[book.sheetnames[0]]
    for row in [("t [s]", "x [mm]"), *PAIRS]:
        sheet.append(row)
    book.save(path)


def _waveform(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        about = {"unit_string": "um", "wf_increment": 1 / 2000, "wf_start_offset": 0.0}
        writer.write_segment([ChannelObject("Run", "x", 1e6 * X, about), ChannelObject("Run", "v", X)])


def _classic(path: Path) -> None:
    with scipy.io.netcdf_file(path, "w") as file:
        file.createDimension("time", N)
        for name, values in (("time", T), ("x", X)):
            variable = file.createVariable(name, "d", ("time",))
            variable[:] = values
            variable.units = b"s" if name == "time" else b"m"


def _table(path: Path) -> None:
    import pyarrow.parquet

    pyarrow.parquet.write_table(pyarrow.table({"t": T, "x [um]": 1e6 * X}), path, compression="gzip")


def _universal(path: Path, binary: int) -> None:
    import pyuff

    data = pyuff.prepare_58(
        binary=binary, func_type=1, rsp_node=3, rsp_dir=3, ref_node=1, ref_dir=1, data=1e6 * X, x=T,
        abscissa_spacing=1, abscissa_min=0.0, abscissa_inc=1 / 2000, abscissa_spec_data_type=17,
        ordinate_spec_data_type=8, ordinate_axis_units_lab="um", abscissa_axis_units_lab="s",
        orddenom_spec_data_type=0,
    )  # fmt: skip
    path.unlink(missing_ok=True)
    with warnings.catch_warnings():
        # pyuff does not close the files that it writes.
        warnings.simplefilter("ignore", ResourceWarning)
        pyuff.UFF(str(path)).write_sets(data, "add")


def _raster(path: Path, compression: int) -> None:
    from asammdf import MDF, Signal

    with MDF(version="4.10") as file:
        file.append([Signal(1e6 * X, T, name="x", unit="um"), Signal(X, T, name="v", unit="m/s")])
        file.save(path, overwrite=True, compression=compression)


SEEDS: dict[str, Callable[[Path], object]] = {
    "comma.csv": _text,
    "blanks.txt": lambda path: _text(path, " ", "# t x"),
    "clock.csv": _logger,
    "wide.tsv": lambda path: path.write_bytes(
        "".join(f"{t},5\t{x}\n".replace(".", ",") for t, x in PAIRS).encode("utf-16")
    ),
    "book.xlsx": _workbook,
    "own.csv": lambda path: write(record(), path),
    "stored.npz": lambda path: np.savez(path, t=T, x=X),
    "packed.npz": lambda path: np.savez_compressed(path, t=T, x=X),
    "own.npz": lambda path: write(record(), path),
    "plain.h5": _hdf5,
    "own.h5": lambda path: write(record(), path),
    "scales.nc": _netcdf,
    "v4.mat": lambda path: scipy.io.savemat(path, {"t": T, "x": X, "text": "abc"}, format="4"),
    "v5.mat": lambda path: scipy.io.savemat(path, _tree()),
    "packed.mat": lambda path: scipy.io.savemat(path, _tree(), do_compression=True),
    "v73.mat": _matlab73,
    "wave.tdms": _waveform,
    "classic.nc": _classic,
    "table.parquet": _table,
    "text.uff": lambda path: _universal(path, 0),
    "bytes.uff": lambda path: _universal(path, 1),
    "raster.mf4": lambda path: _raster(path, 0),
    "packed.mf4": lambda path: _raster(path, 2),
    "rig.toml": lambda path: path.write_text(RIG),
    "fit.json": lambda path: fit().save(path),
}
"""Writers of the files, by name."""


def write_seeds(folder: Path) -> dict[str, bytes]:
    """Write all seed files into a folder and return their contents."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, build in SEEDS.items():
        build(folder / name)
    json.loads((folder / "fit.json").read_text())
    return {name: (folder / name).read_bytes() for name in SEEDS}
