"""Figures keep matplotlib's global state, and files are complete or absent."""

import subprocess
import sys

import matplotlib
import numpy as np
import pytest
from matplotlib.image import imread

from fricjax.errors import UsageError
from fricjax.show import axis_label, figure, save, scaled, styled
from tests.helpers import largest


def decay():
    t = np.linspace(0, 2, 2000)
    return t, 2e-3 * (1 - t / 2) * np.cos(20 * t)


def picture():
    made, axes = figure(2, share_x=True, heights=(2, 1))
    t, x = decay()
    for row, (name, values) in enumerate({"Displacement": x, "Residual": 5e-9 * np.sin(900 * t)}.items()):
        shown, unit = scaled(values, "m")
        axes[row, 0].plot(t, shown)
        axes[row, 0].set_ylabel(axis_label(name, unit))
    axes[1, 0].set_xlabel(axis_label("Time", "s"))
    return made, axes


def test_labels_carry_the_unit_that_suits():
    _, axes = picture()
    assert [each.get_ylabel() for each in axes[:, 0]] == ["Displacement [mm]", "Residual [nm]"]
    assert axis_label("Ratio", "") == "Ratio"


def test_scaled_ignores_gaps():
    shown, unit = scaled([np.nan, 2e-6, -np.inf], "m")
    assert unit == "um"
    assert shown[1] == pytest.approx(2.0)
    assert scaled([], "m")[1] == "m"


@pytest.mark.parametrize("ending", [".png", ".svg", ".pdf"])
def test_save_writes_one_whole_file(tmp_path, ending):
    made, _ = picture()
    assert save(made, tmp_path / f"plot{ending}").stat().st_size > 1000
    assert [each.name for each in tmp_path.iterdir()] == [f"plot{ending}"]


def test_the_picture_is_not_blank(tmp_path):
    pixels = imread(save(picture()[0], tmp_path / "plot.png"))
    assert pixels[..., :3].min() < 0.3 < pixels[..., :3].mean()


def test_a_wrong_ending_leaves_nothing(tmp_path):
    with pytest.raises(ValueError, match=r"cannot be written as 'plot\.xyz'.*\.png"):
        save(picture()[0], tmp_path / "plot.xyz")
    assert not list(tmp_path.iterdir())


def test_a_picture_goes_only_where_it_may_and_where_there_is_space(tmp_path):
    made, _ = picture()
    target = save(made, tmp_path / "plot.png")
    before = target.read_bytes()
    with pytest.raises(FileExistsError, match="give overwrite=True"):
        save(made, target)
    with largest(50), pytest.raises(OSError, match="no space left"):
        save(made, target, overwrite=True)
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [before]


def test_a_failed_write_keeps_the_old_file(tmp_path, monkeypatch):
    made, _ = picture()
    target = tmp_path / "plot.png"
    target.write_text("old")
    monkeypatch.setattr(made, "savefig", lambda *a, **k: (_ for _ in ()).throw(OSError("disk full")))
    with pytest.raises(OSError, match="disk full"):
        save(made, target, overwrite=True)
    assert [each.read_text() for each in tmp_path.iterdir()] == ["old"]


def test_notebooks_get_a_png():
    made, _ = picture()
    assert made._repr_png_().startswith(b"\x89PNG")  # pyright: ignore[reportAttributeAccessIssue]


def test_no_global_state_is_touched():
    before = dict(matplotlib.rcParams)
    picture()
    assert dict(matplotlib.rcParams) == before
    code = "import sys, fricjax.show as s; s.figure(); print('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"


def test_matplotlib_is_imported_on_demand():
    code = "import sys, fricjax.show; print('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"


@pytest.mark.parametrize(("name", "millimetres"), [("column", 85), ("page", 178)])
def test_a_style_is_the_width_and_type_of_a_journal(tmp_path, name, millimetres):
    made, axes = picture()
    axes[0, 0].set_title("text of the caption")
    assert styled(made, name) is made
    assert made.get_size_inches()[0] * 25.4 == pytest.approx(millimetres)
    assert axes[0, 0].get_title() == "" and axes[1, 0].xaxis.label.get_fontsize() == 8
    assert save(made, tmp_path / "plot.pdf").read_bytes().startswith(b"%PDF")


def test_a_style_of_ones_own_and_one_that_there_is_not():
    assert styled(picture()[0], {"width": 4.0}).get_size_inches()[0] == 4.0
    with pytest.raises(UsageError, match=r"There is no style 'colum'. Did you mean 'column'\? Known are screen"):
        styled(picture()[0], "colum")
    with pytest.raises(UsageError, match=r"A style has no 'widht'. Did you mean 'width'\?"):
        styled(picture()[0], {"widht": 4.0})
