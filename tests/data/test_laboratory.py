"""Files in the layouts of laboratory programs.

Each file holds a decay under Coulomb friction, computed stroke by stroke in closed form. It is read with the options
that a user would type.
"""

import itertools
import json
import shlex

import numpy as np
import pytest
import scipy.io

from tests.cli.conftest import call
from tests.tables import check_rows

RATE, OMEGA, DEAD_BAND, X0 = 200.0, 2 * np.pi * 4.0, 1.2e-4, 2e-3


def decay(x0=X0, count=500, band=DEAD_BAND):
    """Return times and positions of a decay under Coulomb friction."""
    t, half = np.arange(count) / RATE, np.pi / OMEGA
    x, start, from_ = np.full(count, np.nan), 0.0, x0
    while abs(from_) > band:
        centre = np.sign(from_) * band
        here = (t >= start - 1e-12) & (t < start + half - 1e-12)
        x[here] = centre + (from_ - centre) * np.cos(OMEGA * (t[here] - start))
        start, from_ = start + half, 2 * centre - from_
    x[np.isnan(x)] = from_
    return t, x


T, X = decay()
LATER, SHORTER = decay(1.5e-3, 400)


def lines(*rows, end="\n"):
    return end.join(rows) + end


def row(*values, digits=6, delimiter=",", decimal="."):
    cells = ["" if value is None else value if isinstance(value, str) else f"{value:.{digits}f}" for value in values]
    return delimiter.join(cells).replace(".", decimal) if decimal != "." else delimiter.join(cells)


def two_runs(title, first, second, **how):
    """Return two runs side by side; the shorter one ends in blanks."""
    longer = max(len(first[0]), len(second[0]))
    cells = [[*run[0], *[None] * (longer - len(run[0]))] for run in (first, second) for run in ((run[0],), (run[1],))]
    return [title, *(row(*values, **how) for values in zip(*cells, strict=True))]


def clock(seconds):
    """Return a time of day just before midnight."""
    whole = 86398.0 + seconds
    hours, rest = divmod(whole % 86400.0, 3600.0)
    return f"{int(hours):02d}:{int(rest // 60):02d}:{rest % 60:06.3f}"


MM = 1e3 * X
PAIRS = list(zip(T, MM, strict=True))
FIRST = (LATER, 1e3 * SHORTER)


def rows(**how):
    """Return one row for each sample, in s and mm."""
    return [row(*pair, **how) for pair in PAIRS]


PASCO = lines(
    *two_runs('"Time (s) Run #1","Position (mm) Run #1","Time (s) Run #2","Position (mm) Run #2"', FIRST, (T, MM))
)
STACKED = lines("t_s,x_mm", *(row(*pair) for pair in zip(*FIRST, strict=True)), "", "t_s,x_mm", *rows())
LABVIEW = lines(
    "LabVIEW Measurement\t",
    "Separator\tTab",
    "***End_of_Header***\t",
    "\t",
    "Channels\t1\t\t",
    "Y_Unit_Label\tmm\t",
    "Delta_X\t0,005\t",
    "***End_of_Header***\t\t",
    "X_Value\tWeg\tComment",
    *(row(*pair, *(["let go"] if i == 7 else []), delimiter="\t", decimal=",") for i, pair in enumerate(PAIRS)),
)
WITHOUT_COMMENTS = LABVIEW.replace("\tlet go", "")
SETTINGS = ["Record Length,500", "Vertical Units,mm", "Probe,1.0", *[","] * 497]
TEKTRONIX = lines(*(f"{left},,{right}" for left, right in zip(SETTINGS, rows(), strict=True)))
LOGGER = lines(
    "Date/Time,OUT1 [mm],Remark",
    *(f"2024-03-05 {clock(a)},{b:.6f},{'at rest, at last' if i == 480 else ''}" for i, (a, b) in enumerate(PAIRS)),
)
GERMAN = [row(1e3 * a, b, delimiter=";", decimal=",") for a, b in PAIRS]
FIXED = [f"{a:10.4f}   {b:10.6f}" for a, b in PAIRS]

# File name, content, words of the command.
TEXTS = {
    "PASCO Capstone": ("run.csv", PASCO, "--run 2"),
    "PASCO Capstone, tabs": (
        "run.txt",
        lines("Time (s) Run #3\tAngle, Ch 1+2 (mrad) Run #3", *rows(delimiter="\t")),
        "",
    ),
    "Vernier": (
        "run.csv",
        lines("Latest: Time (s),Latest: Position (mm),Latest: Velocity (mm/s)", *(row(*pair, 0.0) for pair in PAIRS)),
        "",
    ),
    "Tracker": (
        "run.txt",
        lines("\tmass_A\t", "t\tx_mm\ty_mm", *(row(*pair, 0.0, delimiter="\t") for pair in PAIRS)),
        "--column x_mm",
    ),
    "LabVIEW": ("run.lvm", LABVIEW, ""),
    "LabVIEW, without comments": ("run.lvm", WITHOUT_COMMENTS, ""),
    "Tektronix": ("run.csv", TEKTRONIX, ""),
    "PicoScope": (
        "run.csv",
        lines("Time,Channel A", "(ms),(mV)", "", *(row(1e3 * a, b) for a, b in PAIRS)),
        "--unit '1 mm/mV'",
    ),
    "Rigol": (
        "run.csv",
        lines("X,CH1,Start,Increment,", "Sequence,Volt,0.0,5e-3", *(f"{i},{b:.6f}," for i, b in enumerate(MM))),
        "--unit '1 mm/V' --rate 200",
    ),
    "phyphox": ("run.csv", lines('"Time (s)","Position (mm)"', *rows()), ""),
    "Excel, German": ("run.csv", lines("Zeit [ms];Weg [mm]", *GERMAN, end="\r\n"), ""),
    "units below names": ("run.asc", lines("Zeit\tWeg", "s\tmm", *rows(delimiter="\t")), ""),
    "rule below titles": (
        "run.dat",
        lines("  time [s]   displ [mm]", "  --------   ----------", *FIXED),
        "",
    ),
    "logger, time of day": ("run.csv", LOGGER, ""),
    "microcontroller": ("run.log", lines("millis,x_mm", *(f"{1e3 * a:.0f},{b:.6f}" for a, b in PAIRS)), ""),
    "displacement first": ("run.csv", lines("Weg_mm,Zeit_s", *(row(b, a) for a, b in PAIRS)), ""),
    "several runs, one below the other": ("run.csv", STACKED, "--run 2"),
    "numbered columns": ("run.csv", lines(*two_runs("t1,x1_mm,t2,x2_mm", (T, MM), FIRST)), "--run 1"),
    "thousands": (
        "run.csv",
        lines("Time (s),Displacement (um)", *(f'{a:.4f},"{1e3 * b:,.3f}"' for a, b in PAIRS)),
        "",
    ),
    "words below": ("run.csv", lines("t [s],x [mm]", *rows(), ",", ",", "End of data"), ""),
    "remarks among rows": ("run.csv", lines("t [s],x [mm]", "# note", *rows(), "# end"), ""),
    "unit next to the value": ("run.csv", lines("Time (s),Reading,Unit", *(row(*pair, "mm") for pair in PAIRS)), ""),
    "sample numbers": (
        "run.csv",
        lines("Index,Displacement [mm]", *(f"{i},{b:.6f}" for i, b in enumerate(MM))),
        "--rate 200",
    ),
}


def inspected(path, words=""):
    """Call `fricjax inspect` on a file."""
    return call("inspect", path, *shlex.split(words), "--json")


def agrees(called, *, unit="m", scale=1.0):
    assert called.code == 0, called.out
    found = json.loads(called.out)
    assert found["unit"] == unit
    assert found["samples"] == T.size
    assert found["rate"] == pytest.approx(RATE, rel=1e-6)
    assert found["amplitude"] == pytest.approx(scale * (X0 - DEAD_BAND), rel=0.03)
    assert found["half_period"] == pytest.approx(np.pi / OMEGA, rel=0.01)
    return found


def test_text_of_a_program(tmp_path):
    def check(program):
        name, content, words = TEXTS[program]
        path = tmp_path / name
        path.write_bytes(content.encode("latin-1"))
        found = agrees(inspected(path, words), unit="rad" if "tabs" in program else "m")
        assert found["warnings"] == []

    check_rows(check, list(TEXTS))


def test_encodings_and_ends_of_lines(tmp_path):
    path = tmp_path / "run.txt"
    micrometres = [row(a, 1e3 * b, delimiter="\t") for a, b in PAIRS]

    def check(encoding, end):
        path.write_bytes(lines("Zeit [s]\tWeg [µm]", *micrometres, end=end).encode(encoding))
        agrees(inspected(path))

    check_rows(check, itertools.product(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "latin-1"], ["\n", "\r\n", "\r"]))


def structure(values, label):
    return {"values": values[:, None], "dimensions": 1.0, "label": label}


LABELS = ("torque", "position [mm]", "speed", "a", "b")
MATLAB = {
    "names with units": ({"t_s": T, "x_mm": MM, "note": "a run"}, ""),
    "structure": ({"meas": {"time": T, "angle_mrad": MM, "operator": "N. N."}}, ""),
    "timeseries": ({"ts": {"Name": "x", "Time": T[:, None], "Data": MM[:, None], "DataInfo": {"Units": "mm"}}}, ""),
    "Simulink, five signals": (
        {
            "out": {
                "time": T[:, None],
                "signals": np.array(
                    [
                        structure(k * MM, label)
                        for k, label in enumerate(("torque", "position [mm]", "speed", "a", "b"))
                    ],
                    dtype=object,
                ),
            }
        },
        "--column 'position [mm]'",
    ),
    "matrix": ({"data": np.stack([T, MM], axis=1)}, "--unit mm"),
}


def test_matlab(tmp_path):
    def check(kind):
        variables, words = MATLAB[kind]
        scipy.io.savemat(tmp_path / "run.mat", variables)
        agrees(inspected(tmp_path / "run.mat", words), unit="rad" if kind == "structure" else "m")

    check_rows(check, list(MATLAB))


def test_simulink_names_its_signals(tmp_path):
    scipy.io.savemat(tmp_path / "run.mat", {**MATLAB["Simulink, five signals"][0]})
    found = json.loads(inspected(tmp_path / "run.mat", "--column pos").out)
    assert found["exit_code"] == 4 and "'torque', 'position', 'speed'" in found["error"]


def workbook(path, **sheets):
    import openpyxl

    book = openpyxl.Workbook()
    del book[book.sheetnames[0]]
    for title, rows in sheets.items():
        sheet = book.create_sheet(title)
        for each in rows:
            sheet.append(each)
    book.save(path)


def test_excel(tmp_path):
    decays = (
        [["Time", "Weg"], ["s", "mm"], *map(list, PAIRS)],
        [["Time [s]", "Weg [mm]"], *map(list, zip(*FIRST, strict=True))],
    )
    decays = [[[float(c) if not isinstance(c, str) else c for c in line] for line in each] for each in decays]
    path = tmp_path / "run.xlsx"
    workbook(path, Info=[["load", 9.66], ["operator", "N. N."]], Data=decays[0])
    agrees(inspected(path))
    workbook(path, First=decays[0], Second=decays[1])
    agrees(inspected(path, "--run First"))
    asked = inspected(path)
    assert asked.code == 4 and "holds 2 runs" in asked.out
    path.write_bytes(b"PK\x03\x04 no workbook")
    assert "damaged or of another format" in inspected(path).out


def test_several_runs_are_listed(tmp_path):
    path = tmp_path / "sheet.csv"
    path.write_text(PASCO)
    asked = call("inspect", path)
    assert asked.code == 4
    assert "sheet.csv holds 2 runs; choose one with" in asked.err
    table = [line.split() for line in asked.err.splitlines()[1:]]
    assert table[2:4] == [
        ["Run", "1", "Position", "400", "1.995", "s", "mm"],
        ["Run", "2", "Position", "500", "2.495", "s", "mm"],
    ]
    every = json.loads(inspected(path, "--run all").out)
    assert [run["samples"] for run in every["runs"]] == [400, 500]
    assert [run["source"] for run in every["runs"]] == ["sheet.csv, Run 1", "sheet.csv, Run 2"]
    assert "has no run '7'. Its runs are 'Run 1', 'Run 2'" in " ".join(inspected(path, "--run 7").out.split())
