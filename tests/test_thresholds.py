"""A factor of two in a threshold leaves ordinary results unchanged."""

import functools
from pathlib import Path

import numpy as np
import pytest

import fricjax as fj
from fricjax import thresholds
from fricjax.fitting.population import population

NAMES = [name for name in vars(thresholds) if name.isupper()]
FREE = ("mu", "damping", "stiffness")
MACHINE = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
SMALL = 0.1
"""Part of a standard error that a value may move by."""


def _ar(x, size, memory):
    kicks, noise = size * np.random.default_rng(7).standard_normal(x.size), np.zeros(x.size)
    for i in range(1, x.size):
        noise[i] = memory * noise[i - 1] + kicks[i]
    return x + noise


@functools.cache
def record(name):
    """Return a run with a kind of noise; all share programs."""
    kinds = {
        "white": {"noise": 2e-9},
        "drifting": {"noise": 2e-9, "drift": 1e-6, "quantisation": 5e-9},
        "shaken": {"noise": 1e-9, "floor_acceleration_psd": 1e-9},
        "coloured": {"noise": 0.0},
        "larger": {"noise": 2e-9},
    }
    run = fj.synthetic_run(MACHINE, 2e-3, rate=5e3, duration=0.4, seed=3, **kinds[name])
    if name == "coloured":
        return fj.Record(run.t, _ar(run.x, 2e-9, 0.9))
    return fj.Record(run.t, run.x, sigma=1e-9 if name == "larger" else None)


def fitted(name):
    return fj.fit(record(name), MACHINE, FREE, throw=False)


@functools.cache
def before(name):
    return fitted(name)


RUNS = ("white", "drifting", "shaken", "coloured", "larger")


def test_each_says_where_it_comes_from():
    """The sentence below each of them names its origin."""
    source = Path(thresholds.__file__).read_text()
    for name in NAMES:
        text = source.split(f"\n{name} = ")[1].split('"""')[1]
        assert any(origin in text for origin in ("Derived", "Convention", "Tuned")), name


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("name", NAMES)
def test_half_or_twice_as_large_it_moves_no_value(monkeypatch, name, factor):
    expected = {run: before(run) for run in RUNS}
    monkeypatch.setattr(thresholds, name, factor * getattr(thresholds, name))
    for run, was in expected.items():
        now = fitted(run)
        assert now.status == was.status, run
        for each in FREE:
            assert abs(now.values[each] - was.values[each]) <= SMALL * was.std_errors[each], (run, each)
            assert now.std_errors[each] == pytest.approx(was.std_errors[each], rel=SMALL), (run, each)


@pytest.mark.slow
def test_far_off_it_is_seen(monkeypatch):
    """With an impossible threshold, coloured noise counts as white, with small errors."""
    was = before("coloured").std_errors["mu"]
    monkeypatch.setattr(thresholds, "VERY_STRONG", 1e6)
    assert fitted("coloured").std_errors["mu"] < 0.7 * was


def compared():
    """Compare a fitted and a known damping, both by the closed form."""
    return fj.compare(record("white"), [MACHINE, MACHINE], [FREE, ("mu", "stiffness")], names=["fitted", "known"])


@pytest.mark.slow
@pytest.mark.parametrize("factor", [0.5, 2.0])
@pytest.mark.parametrize("name", ["EXCESS", "RARE", "SURE", "EXTREME"])
def test_a_comparison_ranks_as_before(monkeypatch, name, factor):
    was = compared()
    monkeypatch.setattr(thresholds, name, factor * getattr(thresholds, name))
    now = compared()
    assert now.ranking == was.ranking == ("known", "fitted")
    assert [row.bic for row in now.rows] == pytest.approx([row.bic for row in was.rows], abs=0.5)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_run_that_does_not_belong_is_set_aside_as_before(monkeypatch, factor):
    values = 0.05 + 1e-4 * np.random.default_rng(1).standard_normal(30)
    values[3] = 0.06
    was = population(values, np.full(30, 1e-6))
    monkeypatch.setattr(thresholds, "RARE", factor * thresholds.RARE)
    assert population(values, np.full(30, 1e-6)) == was and was.outliers == (3,)
