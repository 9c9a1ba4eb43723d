"""Fits of records with coloured noise of known covariance."""

import dataclasses

import numpy as np
import pytest
from scipy.linalg import solve_toeplitz, toeplitz
from scipy.signal import lfilter

from fricjax import Fit, Oscillator, Trace, fit, fit_batch, synthetic_run
from fricjax.fitting import rows
from fricjax.fitting.noise_weighting import weigh_by_noise
from fricjax.fitting.solve import solve
from fricjax.friction import Coulomb
from tests.fitting.problem_of import problem_of
from tests.fitting.test_evaluation import whole
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, RIGS, STIFFNESS, clean, coulomb_run, oscillator, truth

RIG = RIGS["rolling"]
MODEL = oscillator(RIG, "Coulomb")
T, X = clean("rolling", "Coulomb")
SIZE = 2e-8


def autoregressive(rho: float, seed: int, size: float = SIZE) -> np.ndarray:
    drive = np.random.default_rng(seed).standard_normal(T.size)
    drive[1:] *= np.sqrt(1 - rho**2)
    return size * np.asarray(lfilter([1.0], [1.0, -rho], drive))


def white(seed: int, size: float = SIZE) -> np.ndarray:
    return size * np.random.default_rng(seed).standard_normal(T.size)


def fitted(noise: np.ndarray, **settings) -> Fit:
    return fit(Trace(T, X + noise), MODEL, MACHINE, **settings)


def errors(found: Fit) -> np.ndarray:
    """Errors of the machine's coefficients, in standard errors."""
    true = truth("rolling", "Coulomb", found)
    return np.array([(found.values[name] - true[name]) / found.std_errors[name] for name in MACHINE])


def assert_same(found: Fit, other: Fit, within: float = 0.1, bars: float = 0.03):
    """Check that values and standard errors of two fits agree.

    `within` is the tolerance of the values in standard errors, `bars` the relative one of the standard errors.
    """
    for name in MACHINE:
        assert abs(found.values[name] - other.values[name]) < within * other.std_errors[name], name
        assert found.std_errors[name] == pytest.approx(other.std_errors[name], rel=bars), name


def test_white_noise_is_left_to_plain_least_squares():
    problem = problem_of(Trace(T, X + white(0)), MODEL, MACHINE)
    solution = solve(problem)
    counted = weigh_by_noise(problem, solution, True)
    assert counted.solution is solution and counted.variance == 1.0 and not counted.went_on
    assert not list(counted.noises[0].words("m"))
    assert counted.white == pytest.approx(np.sqrt(np.diag(solution.shape.inverse)))


@pytest.mark.parametrize("rho", [0.9, 0.99])
def test_standard_errors_are_those_of_the_known_covariance(rho):
    """Compare with generalised least squares of all samples for known stationary noise."""
    problem = problem_of(Trace(T, X + autoregressive(rho, 3)), MODEL, MACHINE)
    found = concluded_errors(problem)
    jacobian = np.asarray(whole(problem.residual, solve(problem).y)[1])
    window = problem.windows[0]
    used = np.flatnonzero(window.used)
    columns = jacobian[used] * window.sigma[used, None]
    # Unused samples could lie only at the beginning, because no rounded value repeats here.
    assert np.all(np.diff(used) == 1)
    row = SIZE**2 * rho ** np.arange(used.size)
    scale = np.linalg.norm(columns, axis=0)
    information = (columns / scale).T @ solve_toeplitz(row, columns / scale)
    expected = np.sqrt(np.diag(np.linalg.inv(information))) / scale
    assert found == pytest.approx(expected, rel=0.15)


def concluded_errors(problem) -> np.ndarray:
    counted = weigh_by_noise(problem, solve(problem), True)
    assert counted.went_on and counted.variance == 1.0
    return np.sqrt(np.diag(counted.solution.shape.inverse))


def test_a_known_covariance_solves_as_a_toeplitz_matrix_does():
    """Check the oracle above against the full matrix."""
    row = 0.9 ** np.arange(50)
    right = np.random.default_rng(0).standard_normal((50, 2))
    assert solve_toeplitz(row, right) == pytest.approx(np.linalg.solve(toeplitz(row), right))


def walked(seed: int) -> Fit:
    """Fit a run with a random walk as noise.

    The run includes a rest. Without one, a random walk cannot be separated from model error.
    """
    run = coulomb_run(mu=RIG.mu, load=RIG.load, samples=24000, noise=1e-15)
    return fit(
        Trace(run.t, run.x + np.cumsum(5e-9 * np.random.default_rng(seed).standard_normal(run.n))), MODEL, MACHINE
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    "fitted", [lambda seed: fitted(autoregressive(0.9, seed)), lambda seed: fitted(autoregressive(0.99, seed)), walked]
)
def test_estimates_scatter_by_their_standard_errors(fitted):
    found = [fitted(seed) for seed in range(24)]
    true = {"mu": RIG.mu, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS}
    scores = np.array([[(f.values[n] - true[n]) / f.std_errors[n] for n in MACHINE] for f in found])
    assert np.sqrt(np.mean(scores**2, axis=0)) == pytest.approx(1.0, abs=0.4)
    assert np.max(np.abs(scores)) < 4
    assert all(each.converged and each.noises[0].memory > 0 for each in found)
    assert all(each.std_errors["mu"] > 2 * each.white_std_errors["mu"] for each in found)


@pytest.mark.slow
def test_on_noise_that_never_forgets_the_fit_lies_in_the_middle_of_the_record():
    """Check the offset under a random walk.

    The mean of a random walk carries no information on the offset, so its standard error is as large as the walk.
    """
    found = [walked(seed) for seed in range(8)]
    for each in found:
        residuals = each.residuals[np.isfinite(each.residuals)]
        assert abs(np.mean(residuals)) < np.std(residuals)
        assert each.converged and np.std(residuals) < 5e-9 * np.sqrt(residuals.size)
    assert all(0.5 < each.std_errors["offset"] / each.residual_rms < 2 for each in found)


def test_a_drift_is_fitted_beside_the_motion():
    noise = white(1) + 1e-6 * T
    found, asked = fitted(noise), fitted(noise, nuisance=("t_release", "x0", "offset", "drift"))
    assert found.noises[0].drift == pytest.approx(1e-6, abs=4 * asked.std_errors["drift"])
    assert_same(found, asked)
    assert "drifts by 1 um/s" in found.summary() and found.converged


def test_a_hum_is_taken_out():
    noise = white(2)
    hum = 1e-6 * np.sin(2 * np.pi * 50.03 * T + 0.4)
    found, quiet = fitted(noise + hum), fitted(noise)
    (line,) = found.noises[0].lines
    assert line.frequency == pytest.approx(50.03, abs=1e-3)
    assert np.hypot(line.cosine, line.sine) == pytest.approx(1e-6, rel=0.01)
    # The same samples also determine two amplitudes and a frequency.
    assert_same(found, quiet, within=0.2)
    assert found.noises[0].at(T - found.origins[0]) == pytest.approx(hum, abs=2e-8)
    # The plot shows the hum on the residuals, with a band for the noise.
    residuals = found.plot().axes[1]
    assert "[um]" in residuals.get_ylabel() and "about drift and hum" in residuals.get_title(loc="left")
    assert 1e-6 * residuals.lines[-1].get_ydata() == pytest.approx(hum, abs=2e-8)


def test_a_strong_hum_over_a_quiet_motion_needs_no_rest():
    """Remove a hum that is mostly averaged out within the rows."""
    n = T.size // 3
    noise = white(4, 1e-9) + 1e-6 * np.sin(2 * np.pi * 50 * T + 1)
    found = fit(Trace(T[:n], (X + noise)[:n]), MODEL, MACHINE)
    assert found.converged and len(found.noises[0].lines) == 1
    assert np.hypot(*found.noises[0].lines[0][1:]) == pytest.approx(1e-6, rel=1e-3)
    assert_same(found, fit(Trace(T[:n], (X + white(4, 1e-9))[:n]), MODEL, MACHINE), within=0.3, bars=0.05)


def test_jitter_of_the_clock_weighs_samples_by_their_velocity():
    tau, speed = 2e-6, np.gradient(X, T)
    noise = white(3, 1e-9) + tau * speed * np.random.default_rng(4).standard_normal(T.size)
    found = fitted(noise)
    asked = fit(Trace(T, X + noise, sigma=np.hypot(1e-9, tau * speed)), MODEL, MACHINE)
    assert found.noises[0].jitter == pytest.approx(tau, rel=0.05)
    assert_same(found, asked, within=0.3, bars=0.1)
    assert np.max(np.abs(errors(found))) < 4


def test_a_model_that_misses_the_record_is_not_whitened():
    run = coulomb_run()
    x = np.where(np.arange(run.n) < 500, run.x, np.asarray(run.x) + 3e-7)
    found = fit(Trace(run.t, x, sigma=1e-9), oscillator(RIGS["sliding"], "Coulomb"), MACHINE)
    assert found.status.startswith("does not describe: ")
    assert all(found.std_errors[name] > 10 * found.white_std_errors[name] for name in MACHINE)


def test_the_number_of_rows_does_not_matter(monkeypatch):
    noise = autoregressive(0.9, 5)
    plain = fitted(noise)
    for factor in (0.5, 2.0):
        monkeypatch.setattr(rows, "_ROWS", factor * 40)
        assert_same(fitted(noise), plain, within=0.25, bars=0.1)


def rounded(seed: int, step: float = 1e-5) -> Trace:
    """Record of a ten-bit converter with a random offset."""
    shift = np.random.default_rng(seed).uniform(-1e-3, 1e-3)
    return Trace(T, step * np.round((X + shift) / step))


def test_the_error_of_rounding_is_a_function_of_the_reading():
    found = [fit(rounded(seed), MODEL, MACHINE) for seed in range(24)]
    scores = np.array([errors(each) for each in found])
    assert np.sqrt(np.mean(scores**2, axis=0)) == pytest.approx(1.0, abs=0.4) and np.max(np.abs(scores)) < 4
    assert all(each.converged and each.noises[0].rounding == pytest.approx(1e-5) for each in found)
    # If the rounding counted as noise, the errors would be larger.
    assert all(each.std_errors["mu"] < 0.6 * each.white_std_errors["mu"] for each in found)
    assert "is rounded to steps of 10 um" in found[0].summary()


@pytest.mark.slow
def test_the_number_of_harmonics_of_the_rounding_does_not_matter(monkeypatch):
    plain = [fit(rounded(seed), MODEL, MACHINE) for seed in range(4)]
    for number in (2, 8):
        monkeypatch.setattr(rows, "_HARMONICS", number)
        for seed, each in enumerate(plain):
            # With more harmonics of the rounding, its remainder is smaller.
            assert_same(fit(rounded(seed), MODEL, MACHINE), each, within=2.0, bars=0.6)


def test_noise_of_more_than_half_a_step_hides_the_rounding():
    step, noise = 2e-8, white(8)
    trace = Trace(T, step * np.round((X + noise) / step))
    # Rounding in steps of one standard deviation adds an independent twelfth of the variance: 0.3 standard errors.
    assert_same(fit(trace, MODEL, MACHINE), fitted(noise), within=1.0, bars=0.06)
    assert not fit(trace, MODEL, MACHINE).noises[0].rounding


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "step", "shows"),
    [
        # Slow noise and a drift hide rounding, though their innovations would not.
        (lambda seed: autoregressive(0.95, seed), 1e-8, False),
        # With a known drift, the rounding is visible.
        (lambda seed: white(seed, 1e-9), 1e-8, True),
        # The drift makes the step to the optimum so long that the model is not linear along it.
        (lambda seed: white(seed, 1e-9), 2e-9, False),
        (lambda seed: white(seed, 1e-9), 5e-8, True),
    ],
    ids=["slow noise", "rounding", "fine steps", "coarse steps"],
)
def test_rounding_and_drift_and_noise_come_together(noise, step, shows):
    records = [step * np.round((X + noise(seed) + 2e-6 * T) / step) for seed in range(8)]
    found = [fit(Trace(T, x), MODEL, MACHINE) for x in records]
    assert [each.status for each in found] == 8 * ["described"]
    assert all(bool(each.noises[0].rounding) == shows for each in found)
    assert [each.noises[0].drift for each in found] == pytest.approx(8 * [2e-6], rel=0.01)
    scores = np.array([errors(each) for each in found])
    assert np.sqrt(np.mean(scores**2, axis=0)) == pytest.approx(1.0, abs=0.6) and np.max(np.abs(scores)) < 4


def test_a_fit_ends_where_its_noise_is_seen_now_in_one_way_now_in_another():
    """End a fit in which two noise models alternate.

    Every second analysis takes the harmonics of the rounding for lines of a hum.
    """
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.02))
    for seed in range(4):
        run = synthetic_run(machine, 1.5e-3, rate=5e3, duration=0.8, noise=1e-12, seed=seed)
        t, x = np.asarray(run.trace.t), np.asarray(run.trace.x) + 2e-6 * np.asarray(run.trace.t)
        x += 1e-9 * np.random.default_rng(seed).standard_normal(t.size)
        found = fit(Trace(t, 5e-8 * np.round(x / 5e-8)), machine, MACHINE)
        assert found.converged and found.numerical_shift < 0.1
        assert abs(found.values["mu"] - 0.02) < 4 * found.std_errors["mu"] < 4e-7


@pytest.mark.parametrize(("sign", "shift"), [(-1, 0.0), (1, 1e-3)])
def test_neither_sign_nor_offset_of_the_record_matters(sign, shift):
    noise = autoregressive(0.9, 6)
    found = fit(Trace(T, sign * (X + noise) + shift), MODEL, MACHINE)
    assert_same(found, fitted(noise), within=1e-3, bars=1e-3)


def test_noise_that_is_only_relative_counts_as_it_is():
    noise = autoregressive(0.99, 7)
    found = fit(Trace(T, X + noise, sigma=1.0), MODEL, MACHINE, sigma_mode="scale")
    assert_same(found, fitted(noise), within=1e-2, bars=1e-2)


@pytest.mark.slow
def test_runs_of_a_joint_fit_count_by_their_own_noise():
    traces = [Trace(T, X + white(8), sigma=SIZE), Trace(T, X + autoregressive(0.99, 9), sigma=SIZE)]
    joint, first = fit(traces, MODEL, MACHINE), fit(traces[0], MODEL, MACHINE)
    assert [noise.memory > 0 for noise in joint.noises] == [False, True]
    for name in MACHINE:
        assert 0.85 * first.std_errors[name] < joint.std_errors[name] < first.std_errors[name]


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
def test_a_batch_counts_by_the_noise_of_each_run():
    traces = [Trace(T, X + white(10)), Trace(T, X + autoregressive(0.99, 11))]
    batch = fit_batch(traces, MODEL, MACHINE)
    for i, trace in enumerate(traces):
        alone = fit(trace, MODEL, MACHINE)
        for name in MACHINE:
            assert batch.values[name][i] == pytest.approx(alone.values[name], abs=0.02 * alone.std_errors[name])
            assert batch.std_errors[name][i] == pytest.approx(alone.std_errors[name], rel=1e-2)
    assert batch.to_dataframe()["noise"][0] == "" and "has a correlation time of" in batch.to_dataframe()["noise"][1]


@pytest.mark.slow
def test_criteria_prefer_the_colour_that_is_there():
    """Compare criteria of the right law and of a law without friction."""
    noise = autoregressive(0.9, 12)
    right = fitted(noise)
    wrong = fit(Trace(T, X + noise), dataclasses.replace(MODEL, friction=Coulomb(0.0)), MACHINE[1:], throw=False)
    assert right.aicc < wrong.aicc and right.bic < wrong.bic
    # The likelihood with the true noise model is far higher than with white noise.
    assert right.aicc < right.chi2 - 1e3


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
def test_a_batch_knows_rounding_and_drift_of_its_runs():
    traces = [rounded(0), Trace(T, X + white(3) + 1e-6 * T), rounded(1)]
    batch = fit_batch(traces, MODEL, MACHINE)
    for i, trace in enumerate(traces):
        alone = fit(trace, MODEL, MACHINE)
        for name in MACHINE:
            assert batch.values[name][i] == pytest.approx(alone.values[name], abs=0.1 * alone.std_errors[name])
            assert batch.std_errors[name][i] == pytest.approx(alone.std_errors[name], rel=0.03)


@pytest.mark.slow
def test_a_robust_fit_of_noise_that_remembers_knows_nothing_of_rows_beyond_its_bend():
    found = fitted(autoregressive(0.9, 1), loss="huber")
    assert found.converged and abs(found.values["mu"] - RIG.mu) < 5 * found.std_errors["mu"]
