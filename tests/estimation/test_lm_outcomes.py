"""Final status of the solver, for single fits and for many lanes.

The cases are walls, non-finite values and too few steps.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import pytest

from fricjax.estimation.levenberg_marquardt import LevenbergMarquardt
from fricjax.estimation.status import (
    AT_BOUND,
    CONVERGED,
    NOT_FINITE,
    OUT_OF_STEPS,
    RUNNING,
    SENTENCES,
    STALLED,
    UNDETERMINED,
)
from tests.fitting.problems import T, clean_decay, decay, noisy_rosenbrock, options_for, solve, status, steps
from tests.tiers import cases

OPTIMUM = (5.0338, 1.6943, 0.4786)
ONES = jnp.full(2, 0.1)


def test_every_status_has_a_sentence():
    codes = [RUNNING, CONVERGED, AT_BOUND, STALLED, NOT_FINITE, OUT_OF_STEPS, UNDETERMINED]
    assert sorted(SENTENCES) == codes
    assert all(text.endswith(".") for text in SENTENCES.values())


BROKEN_AT_THE_START = {
    "nan": lambda p, args=None: decay(p) + jnp.log(p[0]),
    "inf": lambda p, args=None: decay(p) + 1 / (p[0] + 1.0),
    "nan in tangents only": lambda p, args=None: decay(p) + jnp.sqrt(jnp.square(p[0] + 1.0)),
    "square overflows": lambda p, args=None: decay(p) * 1e200,
}


@pytest.mark.parametrize("name", cases(BROKEN_AT_THE_START, ["nan in tangents only"]))
def test_a_start_that_is_not_finite_is_said_to_be_so(name):
    found = solve(BROKEN_AT_THE_START[name], (-1.0, 1.0, 0.0))
    assert (status(found), steps(found)) == (NOT_FINITE, 1)
    assert bool(found.result == optx.RESULTS.nonfinite)
    assert np.asarray(found.value) == pytest.approx([-1.0, 1.0, 0.0], rel=1e-12)
    assert np.all(np.isnan(np.asarray(found.stats["normal"])))


def test_start_values_that_are_not_finite():
    assert status(solve(decay, (jnp.nan, 1.0, 0.0))) == NOT_FINITE


WALL = 3.0


def behind_a_wall(p, beyond):
    return jnp.where(p[0] < WALL, jnp.concatenate([jnp.arctan(p - 1), ONES]), beyond)


@pytest.mark.parametrize("beyond", [jnp.nan, jnp.inf, 1e200])
def test_a_step_beyond_a_wall_is_rejected(beyond):
    """Overshoot with the first Gauss-Newton step.

    On atan(p - 1) it goes from -1.5 to 7.
    """
    start = -1.5
    assert start - np.arctan(start - 1) * (1 + (start - 1) ** 2) > WALL
    found = solve(behind_a_wall, (start,), args=jnp.asarray(beyond))
    assert status(found) == CONVERGED
    assert float(found.value[0]) == pytest.approx(1.0, abs=1e-3)
    assert np.isfinite(float(found.stats["cost"]))


def optimum_behind_a_wall(p, beyond):
    return jnp.where(p[0] < 4.0, decay(p), beyond)


@pytest.mark.parametrize("beyond", [jnp.nan, jnp.inf, 1e200])
def test_an_optimum_behind_a_wall_is_not_called_converged(beyond):
    found = solve(optimum_behind_a_wall, (1.0, 1.0, 0.0), args=jnp.asarray(beyond))
    assert status(found) == STALLED
    assert bool(found.result == optx.RESULTS.nonlinear_divergence)
    assert float(found.value[0]) < 4.0 and np.isfinite(float(found.stats["cost"]))


def with_a_hole(p, at):
    return jnp.where(jnp.abs(p[0] - at) < 1e-6, jnp.nan, decay(p))


@pytest.mark.slow
@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_single_trial_that_is_not_finite_is_stepped_around(number):
    met = solve(decay, (1.0, 1.0, 0.0), max_steps=number).state.trial[0]
    found = solve(with_a_hole, (1.0, 1.0, 0.0), args=met)
    assert status(found) == CONVERGED
    np.testing.assert_allclose(found.value, OPTIMUM, rtol=1e-3)


def test_a_model_that_another_pass_does_not_clear_up_is_no_model():
    """Predict a zero residual that no step ever reaches.

    The solver makes one more pass and then gives up.
    """
    fn = lambda p, args=None: 1e6 * (1 + p - jax.lax.stop_gradient(p)) * jnp.ones(3)
    found = solve(fn, (0.0,), linear=jnp.asarray([True]))
    assert (status(found), steps(found)) == (NOT_FINITE, 2)


def test_a_trial_that_overflows_is_rejected():
    """Overflow in the first step.

    It goes far below zero, where the exponential of the square is infinite.
    """
    fn = lambda p, args=None: jnp.concatenate([jnp.exp(p) - 1e-3 + jnp.expm1(jnp.square(p)), ONES])
    found = solve(fn, (-8.0,))
    assert status(found) == CONVERGED
    assert np.isfinite(float(found.stats["cost"]))


def test_a_better_residual_whose_jacobian_is_not_finite_is_never_accepted():
    """Put the optimum at 5, where the square root has no derivative.

    The fit must stop below 3 and report that it has stalled.
    """
    root = lambda p: 1e-3 * jnp.sqrt(jnp.maximum(3 - p[0], 0.0))
    found = solve(lambda p, args=None: jnp.stack([p[0] - 5 + root(p), 0.1 + 0 * p[0], 0.1 + 0 * p[0]]), (0.0,))
    assert status(found) == STALLED
    assert float(found.value[0]) < 3
    assert np.all(np.isfinite(np.asarray(found.stats["normal"])))


def test_a_kink_is_reached_but_never_called_converged():
    found = solve(lambda p, args=None: jnp.concatenate([1 + jnp.abs(p), jnp.ones(2)]), (0.3,))
    assert status(found) == STALLED
    assert abs(float(found.value[0])) < 1e-3


@pytest.mark.parametrize("own, outer", [(3, 50), (50, 3)])
def test_running_out_of_steps(own, outer):
    start = jnp.asarray([-1.2, 1.0])
    found = optx.least_squares(
        noisy_rosenbrock,
        LevenbergMarquardt(max_steps=own),
        start,
        options=options_for(noisy_rosenbrock, start),
        max_steps=outer,
        throw=False,
    )
    assert (status(found), steps(found)) == (OUT_OF_STEPS, 3)
    assert bool(found.result == optx.RESULTS.nonlinear_max_steps_reached)


def test_data_without_noise_end_at_the_floor_of_rounding():
    fn = lambda p, args=None: clean_decay(p) / 1e-9
    found = solve(fn, (1.0, 1.0, 0.0), floor=float(T.size * (1e-12 * 5.5 / 1e-9) ** 2))
    assert status(found) == CONVERGED
    assert np.asarray(found.value) == pytest.approx([5.0, 1.7, 0.5], rel=1e-10)


def one_after_another(fn):
    return lambda lanes: jax.lax.map(fn, lanes)


def fit_lane(lane):
    """Fit one of five lanes.

    They are a plain fit, an active bound, a wall, a non-finite start, and a parameter without effect.
    """
    wall = jnp.where(lane == 2, 4.0, jnp.inf)
    bound = jnp.where(lane == 1, 4.0, 9.0)
    effect = jnp.where(lane == 4, 0.0, 1.0)

    def fn(p, args=None):
        r = decay(jnp.stack([p[0], p[1], effect * p[2]])) + jnp.where(lane == 3, jnp.nan, 0.0)
        return jnp.where(p[0] < wall, r, jnp.nan)

    options = options_for(decay, jnp.zeros(3), lower=-9.0, upper=jnp.stack([bound, bound + 9, bound + 9]))
    solver = LevenbergMarquardt()
    start = jnp.asarray([1.0, 1.0, 0.0])
    found = optx.least_squares(fn, solver, start, options=options, max_steps=None, throw=False)
    return found.value, found.stats["status"], found.stats["num_steps"]


@pytest.mark.parametrize("map_over", cases([jax.vmap, one_after_another], [jax.vmap]))
def test_each_lane_has_its_own_status_and_nothing_compiles_twice(map_over):
    run = eqx.filter_jit(eqx.debug.assert_max_traces(map_over(fit_lane), max_traces=1))
    value, outcome, taken = run(jnp.arange(5))
    assert outcome.tolist() == [CONVERGED, AT_BOUND, STALLED, NOT_FINITE, UNDETERMINED]
    np.testing.assert_allclose(value[0], OPTIMUM, rtol=1e-3)
    again = run(jnp.arange(5) % 2)
    assert again[1].tolist() == [CONVERGED, AT_BOUND, CONVERGED, AT_BOUND, CONVERGED]
    assert again[2][0] == again[2][2] == taken[0]
