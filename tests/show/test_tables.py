"""Tables line up in a terminal and are escaped in a page."""

from html.parser import HTMLParser

import pytest

from fricjax.show import Table


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
    lines = Table(["what"], [["a"], ["long"]]).text().split("\n")
    assert lines == ["what", "────", "a", "long"]


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
