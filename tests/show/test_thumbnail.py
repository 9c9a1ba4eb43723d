"""Thumbnails: extremes of curves in few bytes, without matplotlib."""

import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

import fricjax as fj
from fricjax.show.thumbnail import Curve, bars_svg, curves_svg

TIME, PATH = ("Time", "s"), ("Displacement", "m")


def places(picture):
    """Parse the points of all lines from the text of a picture."""
    lines = [path.get("d") for path in ElementTree.fromstring(picture).iter("{http://www.w3.org/2000/svg}path")]
    curves = [line for line in lines if line and "L" in line]
    return [np.array([point.split() for point in re.split("[ML]", curve) if point], float) for curve in curves]


def test_a_spike_of_one_sample_in_a_million_is_seen_in_few_bytes():
    t = np.arange(1_000_000) / 1e5
    x = 1e-6 * np.cos(2 * np.pi * 12.5 * t)
    x[123_456], x[700_001] = 5e-6, -4e-6
    picture = curves_svg([Curve(t, x)], TIME, PATH)
    (line,) = places(picture)
    assert len(picture) < 10_000 and "Displacement [um]" in picture and "Time [s]" in picture
    # SVG coordinates point downwards. The axis has a margin of four percent on both sides of its 9 um.
    low, high = line[:, 1].max(), line[:, 1].min()
    assert line[np.argmin(line[:, 1]), 0] == pytest.approx(58 + 392 * (1.23456 / 10 + 0.04) / 1.08, abs=0.2)
    unit = (low - high) / 9
    assert np.median(line[:, 1]) == pytest.approx(high + 5 * unit, abs=1.2 * unit)


def test_the_range_of_a_short_curve_fills_the_frame():
    (line,) = places(curves_svg([Curve([0.0, 1.0, 2.0], [0.0, 2e-3, 1e-3])], TIME, PATH))
    assert line.shape == (3, 2)
    room = 104 * 0.04 / 1.08
    np.testing.assert_allclose(line[:, 1], [114 - room, 10 + room, 62], atol=0.06)


def test_what_is_not_finite_leaves_a_gap():
    picture = curves_svg([Curve([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 1.0, np.nan, 1.0, 0.0])], TIME, PATH)
    (path,) = re.findall(r'd="(M[^"]*L[^"]*)"', picture)
    assert path.count("M") == 2 and path.count("L") == 2 and "nan" not in picture


@pytest.mark.parametrize("x", [[], [np.nan], [np.inf, -np.inf]])
def test_of_nothing_there_is_no_picture(x):
    assert curves_svg([Curve(x, x)], TIME, PATH) == ""


@pytest.mark.parametrize("x", [[1.0], [0.0, 0.0], [1e-300, 2e-300], [1e300, -1e300], [5.0, 5.0]])
def test_of_whatever_is_finite_there_is_one(x):
    for log in (False, True):
        picture = curves_svg([Curve(x, x, np.full(len(x), np.inf))], TIME, PATH, log_x=log)
        assert not picture or (ElementTree.fromstring(picture) is not None and "nan" not in picture)


def test_error_bars_have_the_length_of_the_standard_errors():
    picture = curves_svg([Curve([0.0, 1.0], [0.0, 10.0], [1.0, 2.0])], TIME, ("mu", ""))
    (bars,) = re.findall(r'<path d="(M[^"H]*V[^"H]*V[^"H]*)"/>', picture)
    ends = np.array(re.findall(r"M[\d.]+ ([\d.]+)V([\d.]+)", bars), float)
    lengths = ends[:, 0] - ends[:, 1]
    assert lengths[1] / lengths[0] == pytest.approx(2, abs=0.03) and picture.count("<circle") == 2


def test_bars_are_as_long_as_their_values_and_names_are_text():
    picture = bars_svg(["<b>load</b>", "noise", "lost"], [60.0, 30.0, np.nan], "Share [%]")
    widths = [
        float(bar.get("width") or 0) for bar in ElementTree.fromstring(picture).iter() if bar.tag.endswith("rect")
    ]
    assert widths[0] == pytest.approx(2 * widths[1], rel=1e-3) and len(widths) == 2
    assert "&lt;b&gt;load" in picture and bars_svg(["a"], [np.nan], "x") == ""


def test_the_face_of_a_record_needs_no_matplotlib():
    code = (
        "import sys, numpy as np, fricjax as fj; r = fj.Record(x=np.cos(np.arange(99.0)), rate=9.0); "
        "print('<svg' in r._repr_html_(), 'matplotlib' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout == "True False\n"


def test_pictures_stand_above_a_long_table_and_below_a_short_one():
    short = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
    assert short._repr_html_().startswith("<table>") and short._repr_html_().endswith("</svg>")
    files = fj.data.example_paths()
    long = fj.friction_force_map(files.run, fj.Rig.from_toml(files.rig))
    assert long._repr_html_().startswith("<svg") and long._repr_html_().endswith("</table>")


def test_values_too_far_apart_for_an_axis_give_no_picture():
    assert curves_svg([Curve([0.0, 1.0], [-1e308, 1e308])], TIME, ("Ratio", "")) == ""
