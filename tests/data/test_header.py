"""Column titles of laboratory programs are split into name, unit and run."""

from fricjax.data.readers.header import is_time, split_title

TITLES = {
    "Time [s]": ("Time", "s", None),
    "Displacement (um)": ("Displacement", "um", None),
    "x / mm": ("x", "mm", None),
    "x_mm": ("x", "mm", None),
    "angle_rad": ("angle", "rad", None),
    "t_s": ("t", "s", None),
    "Weg in µm": ("Weg", "µm", None),
    "Position mm": ("Position", "mm", None),
    "Position (mm) Run #1": ("Position", "mm", "Run 1"),
    "Angle, Ch 1+2 (rad) Run #3": ("Angle, Ch 1+2", "rad", "Run 3"),
    "Run 12: Time (s)": ("Time", "s", "Run 12"),
    "Latest: Position (m)": ("Position", "m", "Latest"),
    "run1/nm": ("run1", "nm", None),
    "Run 2 / um": ("Run 2", "um", None),
    "Volt": ("Volt", "Volt", None),
    "counts": ("counts", "counts", None),
    "um": ("um", "um", None),
    "a": ("a", None, None),
    "x_mm_run2": ("x", "mm", "Run 2"),
    "Winkel [°]": ("Winkel", "°", None),
    "Velocity (m/s)": ("Velocity", "m/s", None),
    "Channel A (mV)": ("Channel A", "mV", None),
    "millis": ("millis", "ms", None),
    '"Zeit (ms)"': ("Zeit", "ms", None),
    "Position (smoothed)": ("Position (smoothed)", None, None),
    "x [furlongs]": ("x", "furlongs", None),
    "x_in": ("x_in", None, None),
    "v_s": ("v_s", None, None),
    "mu_s": ("mu_s", None, None),
    "mass_A": ("mass_A", None, None),
    "Displacement": ("Displacement", None, None),
    "": ("", None, None),
}


TIMES = {
    ("Time", None): True,
    ("Elapsed time", "s"): True,
    ("Zeit", "ms"): True,
    ("X_Value", None): True,
    ("frequency", "Hz"): False,
    ("Time of flight", "mm"): False,
    ("anything", "us"): True,
    ("timer", None): False,
    ("x", None): False,
}


def test_titles():
    assert {text: split_title(text) for text in TITLES} == TITLES


def test_times():
    assert {pair: is_time(*pair) for pair in TIMES} == TIMES
