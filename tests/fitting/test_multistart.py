"""Fits from many starts: their optima, their order and their report."""

import functools

import numpy as np
import pytest

from fricjax import Oscillator, fit
from fricjax.errors import UsageError
from fricjax.fitting.multistart import Multistart, multistart
from fricjax.friction import Coulomb
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS, coulomb_run

STARTS = 6


def machine() -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.05))


@functools.cache
def found(seed: int = 0, bound: float | None = None) -> Multistart:
    bounds = {} if bound is None else {"damping": (None, bound)}
    return multistart(coulomb_run(), machine(), MACHINE, starts=STARTS, seed=seed, bounds=bounds, engine="exact")


def test_all_starts_of_an_easy_fit_reach_its_one_optimum():
    reference = fit(coulomb_run(), machine(), MACHINE, engine="exact")
    assert found().share == 1.0 and found().excess.shape == (STARTS,)
    for name in MACHINE:
        assert found().best.values[name] == pytest.approx(reference.values[name], abs=0.01 * reference.std_errors[name])
        distance = np.abs(found().ends[name] - reference.values[name])
        assert np.max(distance) < 0.1 * reference.std_errors[name]
    assert found().best.chi2 == pytest.approx(reference.chi2, rel=1e-9)


def test_the_waterfall_ascends_from_zero():
    assert found().excess[0] == 0.0 and np.all(np.diff(found().excess) >= 0)


def test_starts_are_spread_and_repeat_with_their_seed():
    starts = found().starts["damping"]
    assert np.unique(starts).size == STARTS and np.max(starts) > 1.3 * np.min(starts)
    again = multistart(coulomb_run(), machine(), MACHINE, starts=STARTS, engine="exact")
    np.testing.assert_array_equal(again.starts["mu"], found().starts["mu"])
    assert not np.array_equal(np.sort(found(seed=1).starts["mu"]), np.sort(starts))


def test_the_automatic_start_is_among_them():
    at = found().automatic
    told = [np.abs(found().starts["stiffness"] / STIFFNESS - 1)[at], np.abs(found().starts["mu"] / 0.05 - 1)[at]]
    assert max(told) < 0.01


def test_bounds_that_were_reached_are_told():
    bound = 0.5 * PROTOTYPE_DAMPING
    held = found(bound=bound)
    assert held.at_bounds == (("damping",),) * STARTS
    assert held.best.flags["damping"] == ("at bound",)
    assert f"damping in {STARTS} of {STARTS} starts" in held.summary()


def test_the_report_and_the_waterfall_are_drawn():
    text = found().summary()
    assert f"{STARTS} of {STARTS} reached this optimum" in text and "the automatic start is one of them" in text
    axes = found().plot().axes[0]
    assert "Start" in axes.get_xlabel() and axes.lines[0].get_xdata().size == STARTS


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"starts": 0}, "at least one start"),
        ({"spread": 1.0}, "spread above 1"),
        ({"gues": {}}, r"multistart has no setting 'gues'\. Did you mean 'guess'\?"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings, words):
    with pytest.raises(UsageError, match=words):
        multistart(coulomb_run(), machine(), MACHINE, **settings)
