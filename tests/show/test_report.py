"""Text, HTML, plain data and data frames of a report."""

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import pytest

from fricjax.rig import Measured
from fricjax.show import Report, Reported, Table, plain_data

TABLE = Table(
    ["Parameter", "Value", "Unit"], [["mu", Measured(0.214523, 0.000312), "1"], ["mass", Measured(9.5), "kg"]]
)


@dataclasses.dataclass(frozen=True)
class Result(Reported):
    report_: Report

    def report(self):
        return self.report_


def full(**changes):
    report = Report(
        [TABLE, Table(["Empty"], [])],
        [("noise", "5 nm"), ("samples", "100")],
        ["A note."],
        ["A warning."],
        ["An error < 1."],
        heading="Fit",
        data={"mu": TABLE.rows[0][1], "covariance": np.eye(2), "names": ("mu", "mass")},
    )
    return Result(dataclasses.replace(report, **changes))


def test_text_has_tables_facts_and_marked_sentences():
    assert full().summary().split("\n") == [
        "Parameter        Value  Unit",
        "─────────  ───────────  ────",
        "mu         0.21452(31)  1",
        "mass               9.5  kg",
        "",
        "noise:   5 nm",
        "samples: 100",
        "A note.",
        "!! An error < 1.",
        "! A warning.",
    ]


def test_what_is_empty_leaves_no_blank_lines():
    only = full(facts=(), notes=(), warnings=(), errors=())
    assert only.summary() == TABLE.text()
    assert only._repr_html_() == TABLE.html()
    assert full(tables=[], notes=(), warnings=(), errors=()).summary() == "noise:   5 nm\nsamples: 100"


def test_html_is_escaped_and_says_of_each_sentence_what_it_is():
    page = full()._repr_html_()
    assert page.count("<table>") == 2
    assert "An error &lt; 1." in page
    for kind in ("Fit", "noise", "note", "error", "warning"):
        assert f">{kind}</t" in page, kind


def test_numbers_come_back_with_all_their_digits():
    assert full().to_dict() == {
        "mu": {"value": 0.214523, "std": 0.000312},
        "covariance": [[1.0, 0.0], [0.0, 1.0]],
        "names": ["mu", "mass"],
    }
    frame = full().to_dataframe()
    assert list(frame.columns) == ["parameter", "value", "std", "unit"]
    assert frame["value"].tolist() == [0.214523, 9.5]
    assert frame["std"].tolist() == [0.000312, 0.0]


def test_a_report_without_tables_has_a_frame_of_its_data():
    frame = full(tables=[], data={"noise": 5e-9, "rest": None}).to_dataframe()
    assert frame["noise"].tolist() == [5e-9] and frame["rest"].isna().tolist() == [True]


class Pair(NamedTuple):
    low: float
    high: np.ndarray


@pytest.mark.parametrize(
    ("value", "data"),
    [
        (np.float64(2.0), 2.0),
        ({"a": (1, [np.arange(2)])}, {"a": [1, [[0, 1]]]}),
        (Pair(1.0, np.array([math.inf])), {"low": 1.0, "high": [math.inf]}),
        (None, None),
        ("text", "text"),
    ],
)
def test_plain_data(value, data):
    assert plain_data(value) == data
    assert type(plain_data(value)) is type(data)


def test_a_result_without_a_report_is_none():
    with pytest.raises(TypeError, match="report"):
        type("Bare", (Reported,), {})()
