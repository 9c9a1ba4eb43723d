"""Tables line up in a terminal and are escaped in a page."""

from html.parser import HTMLParser

import numpy as np
import pytest

from fricjax.rig import Measured
from fricjax.show import Cell, Table


def test_text_is_aligned():
    table = Table(["name", "value"], [["mu", "0.21452(31)"], ["damping", 0.5], ["k", None]], title="Friction")
    assert table.text().split("\n") == [
        "Friction",
        "name           value",
        "───────  ───────────",
        "mu       0.21452(31)",
        "damping        0.500",
        "k",
    ]


def test_text_columns_are_left_aligned():
    lines = Table(["name"], [["a"], ["long"]]).text().split("\n")
    assert lines == ["name", "────", "a", "long"]


def test_a_frame_holds_the_numbers_of_the_cells():
    rows = [
        ["mu", Measured(0.2, 0.1), Cell("12 nm", noise=np.float64(1.2e-8), runs=2), Cell("no stop", stop=float("nan"))]
    ]
    rows += [["k", Measured(2.5e3), None, Cell(7, stop=7)]]
    table = Table(["Name", "At R-hat", "Noise", "Stop"], rows, units={"noise": "m"}, limit=1)
    assert table.cells() == [["mu", "0.20(10)", "12 nm", "no stop"]]
    frame = table.to_dataframe()
    assert list(frame) == ["name", "at_r_hat", "at_r_hat_std", "noise", "runs", "stop"]
    assert frame["noise"].isna().tolist() == [False, True] and frame["stop"].isna().tolist() == [True, False]
    assert frame["noise"].tolist()[0] == 1.2e-8
    assert frame["at_r_hat"].tolist() == [0.2, 2500.0] and frame["at_r_hat_std"].tolist() == [0.1, 0.0]
    assert frame.attrs["units"] == {"noise": "m"}


def test_a_row_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="Row 1 has 1 cells under 2 columns"):
        Table(["a", "b"], [[1, 2], [3]])


class _Cells(HTMLParser):
    def __init__(self):
        super().__init__()
        self.data: list[str] = []

    def handle_data(self, data):
        self.data.append(data)


def test_html_is_escaped():
    table = Table(["a<b"], [["<script>alert(1)</script> & more"]], title="x < y")
    cells = _Cells()
    cells.feed(table._repr_html_())
    assert "<script>" not in table.html()
    assert cells.data == ["x < y", "a<b", "<script>alert(1)</script> & more"]


def test_an_empty_table_has_its_heads():
    assert str(Table(["a", "b"], [])) == "a  b\n─  ─"


def test_no_browser_breaks_a_number_or_its_unit():
    short, sentence = "-9.04e-08 N s/m", "residuals of 57.2 mrad are 22.2 times the noise"
    html = Table(["Bias", "Note"], [[short, sentence]]).html()
    assert f'nowrap">{short}<' in html and f'left">{sentence}<' in html
