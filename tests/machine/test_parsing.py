"""Parsing of command-line words."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fricjax.errors import UsageError
from fricjax.machine import parsing

finite = st.floats(allow_nan=False, allow_infinity=False)


def test_words_of_several_options():
    assert parsing.words(["a, b", "c"]) == ["a", "b", "c"]
    assert parsing.words("mu,damping") == ["mu", "damping"]
    assert parsing.words(None) == []


def test_pairs_refuse_what_is_none():
    assert parsing.pairs("--fix", ["a=1,b=2", "c=3"], "a=1") == {"a": "1", "b": "2", "c": "3"}
    with pytest.raises(
        UsageError, match=r"--fix 'a' is not of the form name=value; write for example --fix v_s=1e-5\."
    ):
        parsing.pairs("--fix", ["a"], "v_s=1e-5")
    with pytest.raises(UsageError, match=r"--fix gives a twice, as 1 and as 2\."):
        parsing.pairs("--fix", ["a=1", "a=2"], "a=1")


@given(low=finite, high=finite)
def test_span_round_trips(low, high):
    assert parsing.span("--crop", f"{low!r}:{high!r}") == (low, high)
    assert parsing.span("--crop", f"{low!r}:") == (low, None)
    assert parsing.span("--crop", f":{high!r}") == (None, high)


@pytest.mark.parametrize("text", ["1", ":", "a:b", "1:inf"])
def test_span_refuses(text):
    with pytest.raises(UsageError, match="--crop"):
        parsing.span("--crop", text)


def test_estimates_and_ties():
    assert parsing.estimate("damping", "0.175(2)") == pytest.approx((0.175, 0.002))
    assert parsing.estimate("mu", "0.02 +/- 0.001") == pytest.approx((0.02, 0.001))
    with pytest.raises(UsageError, match="needs a value with its standard deviation"):
        parsing.estimate("mu", "0.02")
    assert parsing.tied("mu") == ("mu", 1.0)
    assert parsing.tied("1.3*friction.0.mu") == ("friction.0.mu", 1.3)
    with pytest.raises(UsageError, match=r"--tie cannot follow '2'"):
        parsing.tied("2")


@pytest.mark.parametrize(
    ("text", "value"), [("2e-3", 2e-3), ("2 mm", 2e-3), ("-5um", -5e-6), ("180 deg", 3.141592653589793)]
)
def test_displacements(text, value):
    assert parsing.displacement("--x0", text) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [("far", "--x0 must be a displacement such as 2e-3"), ("1 kg", "The unit 'kg' does not fit --x0")],
)
def test_displacements_refused(text, sentence):
    with pytest.raises(UsageError, match=sentence):
        parsing.displacement("--x0", text)
