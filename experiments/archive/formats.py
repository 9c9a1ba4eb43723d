"""Writers of the file formats in an archive.

Each writes times [s] and displacements [m] in the way of a laboratory program.
"""

import io
from collections.abc import Callable, Iterable
from pathlib import Path

import h5py
import numpy as np
import scipy.io

import fricjax as fj

type Writer = Callable[[Path, np.ndarray, np.ndarray], object]


def rows(t: np.ndarray, x: np.ndarray, pattern: str) -> str:
    """Format one line for each sample."""
    return "".join([pattern % pair for pair in zip(t.tolist(), x.tolist(), strict=True)])


def _decimal_comma(text: str) -> str:
    return text.replace(".", ",")


def _comma(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    path.write_text("Time [s],Displacement [um]\n" + rows(t, 1e6 * x, "%.6f,%.4f\n"))


def _german(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    table = _decimal_comma(rows(1e3 * t, 1e3 * x, "%.3f;%.7f\r\n"))
    path.write_bytes(f"Zeit [ms];Weg [mm]\r\n{table}".encode("latin-1"))


def _comments(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    path.write_text("# operator: N. N.\n# ball, dry\n# t [s]   x [m]\n" + rows(t, x, "%.6f  % .12e\n"))


def _wide(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    path.write_text("Zeit [s]\tWeg [µm]\n" + _decimal_comma(rows(t, 1e6 * x, "%.6f\t%.4f\n")), encoding="utf-16")


def _units_below(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    path.write_text("time\tdisplacement\ns\tnm\n" + rows(t, 1e9 * x, "%.6f\t%.2f\n"))


def _labview(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    end = "***End_of_Header***"
    head = ["LabVIEW Measurement", "Separator\tTab", end, "", "Channels\t1", "Y_Unit_Label\tmm"]
    head += [f"Delta_X\t{_decimal_comma(repr(float(t[1])))}", end, "X_Value\tWeg\tComment"]
    path.write_text("\n".join([*head, _decimal_comma(rows(t, 1e3 * x, "%.6f\t%.7f\n"))]))


def _logger(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    table = rows(t, 1e3 * x, "2026-03-05 14:23:%09.6f,%.7f,ok\n")
    path.write_text(f"Logger 5, channel 2\n\nTime,Displacement [mm],state\n{table}")


def _npz(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    np.savez(path, t=t, x=x)


def _packed(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    np.savez_compressed(path, time_ms=1e3 * t, x_um=1e6 * x)


def hdf5(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    """Write compressed chunks with checksums, which reveal damage."""
    with h5py.File(path, "w") as file:
        for name, values, unit in (("time", t, "s"), ("displacement", 1e6 * x, "um")):
            node = file.create_dataset(name, data=values, chunks=(1000,), compression="gzip", fletcher32=True)
            node.attrs["units"] = unit


def _netcdf(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    with h5py.File(path, "w", libver="latest") as file:
        file["time"], file["x"] = t, 1e3 * x
        file["time"].attrs["units"], file["x"].attrs["units"] = "s", "mm"
        file["time"].make_scale("time")
        file["x"].dims[0].attach_scale(file["time"])


def _matlab(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    scipy.io.savemat(path, {"meas": {"time": t, "x_mm": 1e3 * x, "operator": "N. N."}}, do_compression=True)


def _matlab73(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t_s", t), ("x_um", 1e6 * x)):
            file.create_dataset(name, data=values[None, :]).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def _workbook(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    import openpyxl

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("run")
    lines: Iterable[tuple] = zip(t.tolist(), (1e3 * x).tolist(), strict=True)
    for line in [("t [s]", "x [mm]"), *lines]:
        sheet.append(line)
    content = io.BytesIO()
    book.save(content)
    path.write_bytes(content.getvalue())


def _own(path: Path, t: np.ndarray, x: np.ndarray) -> None:
    fj.write((t, x), path)


# Ending and writer of each format. Workbooks are slow to write and read, so an archive has few of them.
FORMATS: dict[str, tuple[str, Writer]] = {
    "comma": ("csv", _comma),
    "German Excel": ("csv", _german),
    "comments": ("txt", _comments),
    "UTF-16": ("tsv", _wide),
    "units below": ("asc", _units_below),
    "LabVIEW": ("lvm", _labview),
    "logger": ("csv", _logger),
    "npz": ("npz", _npz),
    "packed npz": ("npz", _packed),
    "HDF5": ("h5", hdf5),
    "netCDF": ("nc", _netcdf),
    "MATLAB 5": ("mat", _matlab),
    "MATLAB 7.3": ("mat", _matlab73),
    "own HDF5": ("h5", _own),
    "own text": ("csv", _own),
}
WORKBOOK = ("xlsx", _workbook)
