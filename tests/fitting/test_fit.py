"""Options of a fit: start, nuisances, noise, priors, bounds, ties, several runs."""

import numpy as np
import pytest

from fricjax import Fit, Measured, Oscillator, Record, Trace, fit, synthetic_run
from fricjax.data import segment_record
from fricjax.fitting import FitError, window
from fricjax.friction import Coulomb, QuadraticDrag, Stribeck
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS, X0, coulomb_run

TRUE = {"mu": 0.05, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS}
LOAD = 9.66


def machine(friction=None, *, damping=PROTOTYPE_DAMPING, stiffness=STIFFNESS, mass=PROTOTYPE_MASS, load=LOAD):
    return Oscillator(mass, stiffness, damping, load, friction or Coulomb(0.05))


@pytest.fixture(scope="module")
def run() -> Trace:
    return coulomb_run()


@pytest.fixture(scope="module")
def plain(run) -> Fit:
    return fit(run, machine(), MACHINE)


def assert_true(found: Fit, true=TRUE, within: float = 4.0):
    for name, value in true.items():
        error = abs(found.values[name] - value)
        assert error < within * found.std_errors[name], f"{name}: {error / found.std_errors[name]:.1f} standard errors"


class TestStart:
    def test_first_reversal_frees_its_time_its_position_and_the_offset(self, plain):
        assert plain.names == (*MACHINE, "t_release", "x0", "offset")
        assert_true(plain, {**TRUE, "offset": 0.0})
        assert plain.values["t_release"] == pytest.approx(0.5 / 12.6, rel=1e-4)
        assert plain.half_cycles == (4,)

    def test_release_starts_at_rest_at_the_first_sample_of_a_trace(self, run):
        found = fit(run, machine(), MACHINE, start="release")
        assert found.names == (*MACHINE, "x0", "offset")
        assert_true(found, {**TRUE, "x0": X0, "offset": 0.0})
        assert found.half_cycles == (5,)
        assert np.all(np.isfinite(found.residuals))

    def test_release_starts_at_the_logged_release_of_a_record(self):
        held = coulomb_run(hold=0.05, offset=1e-4)
        found = fit(Record(held, {"release_time": 0.05}), machine(), MACHINE, start="release")
        assert_true(found, {**TRUE, "x0": X0, "offset": 1e-4})
        assert np.isnan(found.residuals[: round(0.05 * 5e3)]).all()

    @pytest.mark.slow
    @pytest.mark.parametrize("seconds", [0.05, 0.0595, 0.075, 0.0801])
    def test_seconds_start_in_mid_stroke_also_next_to_the_middle_and_to_a_reversal(self, run, seconds):
        found = fit(run, machine(), MACHINE, start=seconds)
        assert found.names == (*MACHINE, "x0", "v0", "offset")
        assert_true(found)
        assert found.chi2_reduced == pytest.approx(1, abs=0.2)
        low, high = found.intervals["mu_s"]
        assert low <= found.values["mu"] + 1e-9 and 0.1 < high < 0.2

    @pytest.mark.slow
    def test_drift_is_separated_from_the_decay(self):
        drifting = coulomb_run(drift=1e-6)
        found = fit(drifting, machine(), MACHINE, nuisance=["t_release", "x0", "offset", "drift"])
        assert_true(found, {**TRUE, "drift": 1e-6})
        assert found.values["offset"] == pytest.approx(1e-6 * 0.5 / 12.6, rel=1e-2)
        assert found.predict(drifting.t[300:]) == pytest.approx(np.asarray(drifting.x[300:]), abs=6e-9)

    @pytest.mark.slow
    def test_an_offset_that_is_not_free_is_zero(self, run):
        found = fit(run, machine(), MACHINE, nuisance=["t_release", "x0"])
        assert float(found.runs[0].fixed["offset"]) == 0.0
        assert_true(found)
        assert found.chi2_reduced == pytest.approx(1, abs=0.2)

    def test_masked_samples_do_not_count(self, run):
        x, mask = np.array(run.x), np.ones(run.n, bool)
        x[400:420], mask[400:420] = 1.0, False
        found = fit(Trace(run.t, x, sigma=run.sigma, mask=mask), machine(), MACHINE)
        assert_true(found)
        assert np.isnan(found.residuals[400:420]).all()
        assert found.dof == np.isfinite(found.residuals).sum() - 6


class TestResult:
    def test_residuals_are_measured_minus_model_and_nan_where_not_fitted(self, run, plain):
        fitted = np.asarray(run.t) >= plain.values["t_release"] - 1e-6
        assert np.array_equal(np.isfinite(plain.residuals), fitted)
        model = plain.predict(np.asarray(run.t)[fitted])
        # The prediction uses the closed form, and the fit tables of forces.
        assert plain.residuals[fitted] == pytest.approx(np.asarray(run.x)[fitted] - model, abs=1e-14)
        assert plain.residual_rms == pytest.approx(np.sqrt(np.nanmean(plain.residuals**2)), rel=1e-12)
        assert plain.chi2 == pytest.approx(np.nansum((plain.residuals / 1e-9) ** 2), rel=1e-12)
        assert plain.chi2_reduced == pytest.approx(plain.chi2 / plain.dof)

    def test_intervals_are_two_sided_95_percent(self, plain):
        for name in plain.names:
            low, high = plain.intervals[name]
            assert (high - low) / 2 == pytest.approx(1.96 * plain.std_errors[name], rel=1e-3)
            assert (high + low) / 2 == pytest.approx(plain.values[name], rel=1e-9)

    def test_correlation_and_covariance_belong_together(self, plain):
        assert np.diag(plain.correlation) == pytest.approx(np.ones(6))
        assert np.sqrt(np.diag(plain.covariance)) == pytest.approx([plain.std_errors[n] for n in plain.names])
        assert plain.correlation[0, 1] < -0.5  # friction and damping both cause decay

    def test_without_a_rig_the_combined_errors_are_the_statistical_ones(self, plain):
        assert plain.combined_std_errors == plain.std_errors

    def test_the_oscillator_is_the_fitted_one(self, plain):
        assert float(plain.oscillator.friction.mu) == plain.values["mu"]  # type: ignore[attr-defined]
        assert float(plain.oscillator.stiffness) == plain.values["stiffness"]

    def test_the_margins_to_another_number_of_half_cycles(self, plain):
        """Compare the margins with the closed form.

        The mass stops at |x| = 79.7 um. At the reversal before, |x| is 455 um. The static band is 187.6 um.
        """
        from tests.oracles import coulomb_viscous

        band = 0.05 * LOAD / STIFFNESS
        points = np.abs(coulomb_viscous(np.zeros(1), X0, frequency=12.6, zeta=0.0027, dead_band=band).points)
        (margin,) = plain.margins
        assert margin.one_more == pytest.approx(band - points[-1], abs=1e-8)
        assert margin.one_less == pytest.approx(points[-2] - band, abs=1e-8)

    def test_the_covariance_is_the_scatter_of_repeated_fits(self, plain):
        estimates = []
        for seed in range(1, 61):
            found = fit(coulomb_run(seed=seed), machine(), MACHINE)
            estimates.append([found.values[name] for name in plain.names])
        scatter = np.cov(np.array(estimates).T)
        std = np.sqrt(np.diag(plain.covariance))
        # A variance from 60 runs has an error of 18 %, a correlation near zero one of 0.13.
        assert np.sqrt(np.diag(scatter)) / std == pytest.approx(np.ones(6), abs=0.4)
        assert scatter / np.outer(std, std) == pytest.approx(plain.correlation, abs=0.6)

    def test_a_record_that_ends_in_motion_has_no_margin(self):
        found = fit(coulomb_run(mu=0.005), machine(Coulomb(0.005)), MACHINE)
        assert_true(found, {**TRUE, "mu": 0.005})
        assert found.half_cycles == (None,) and found.margins == (None,)

    def test_kinematics_need_no_rig(self, run, plain):
        """Fit with mass and load 1, which changes only the scale."""
        bare = fit(run, Oscillator(1.0, 4000.0, 0.0, 1.0, Coulomb(0.1)), MACHINE)
        expected = {
            "natural_frequency": 12.6,
            "damping_ratio": 0.0027,
            "dead_band": 0.05 * LOAD / STIFFNESS,
            "friction_deceleration": 0.05 * LOAD / PROTOTYPE_MASS,
        }
        for name, value in expected.items():
            estimate = bare.kinematics[name]
            assert abs(estimate.value - value) < 4 * estimate.std
            assert estimate.value == pytest.approx(plain.kinematics[name].value, rel=1e-6)
            assert estimate.std == pytest.approx(plain.kinematics[name].std, rel=1e-3)
        assert bare.kinematics["drag_rate"].std == 0.0

    @pytest.mark.parametrize("scale", [1e-3, 1e3])
    def test_other_units_of_length_give_the_same_numbers(self, plain, scale):
        """Scale motion and load by the same factor."""
        found = fit(coulomb_run(scale=scale), machine(load=LOAD * scale), MACHINE)
        assert found.status == "described"
        for name in MACHINE:
            assert found.values[name] == pytest.approx(plain.values[name], abs=1e-3 * plain.std_errors[name])
            assert found.std_errors[name] == pytest.approx(plain.std_errors[name], rel=1e-4)
        assert found.values["x0"] == pytest.approx(scale * plain.values["x0"], rel=1e-9)


class TestNoise:
    def test_absolute_estimated_and_scaled_noise(self, run, plain):
        stated = Trace(run.t, run.x, sigma=3e-9)
        absolute, scale, estimate = (
            fit(stated, machine(), MACHINE, sigma_mode=mode) for mode in ("absolute", "scale", "estimate")
        )
        assert absolute.chi2_reduced == pytest.approx(plain.chi2_reduced / 9, rel=1e-6)
        assert scale.chi2_reduced == pytest.approx(plain.chi2_reduced / 9, rel=1e-6)
        assert estimate.chi2_reduced == pytest.approx(1)
        for name in MACHINE:
            assert absolute.std_errors[name] == pytest.approx(3 * plain.std_errors[name], rel=1e-6)
            true_scatter = plain.std_errors[name] * np.sqrt(plain.chi2_reduced)
            assert scale.std_errors[name] == pytest.approx(true_scatter, rel=1e-6)
            assert estimate.std_errors[name] == pytest.approx(true_scatter, rel=1e-6)
        assert estimate.sigma == pytest.approx(1e-9, rel=0.1)
        assert absolute.sigma_source == "given" and estimate.sigma_source == "scatter of the residuals"

    def test_noise_that_is_not_given_is_estimated_from_the_record(self, run, plain):
        found = fit(Trace(run.t, run.x), machine(), MACHINE)
        assert found.sigma == pytest.approx(1e-9, rel=0.1)
        # A plain record is fitted first.
        assert found.sigma_source == "scatter of the residuals"
        shaken = fit(Trace(run.t, run.x + 5e-9 * np.sin(300 * run.t)), machine(), MACHINE)
        assert shaken.sigma_source == "estimated from the record"
        assert found.std_errors["mu"] == pytest.approx(plain.std_errors["mu"], rel=0.1)

    @pytest.mark.slow
    @pytest.mark.parametrize(("dither", "shift"), [(0.0, 6 / 16), (0.0, 10 / 16), (0.015, 8 / 16)])
    def test_a_rest_that_is_rounded_tells_no_more_than_one_sample(self, dither, shift):
        step = 1e-2 / 2**12
        clean = coulomb_run(mu=0.01, load=1.89, samples=24000, noise=1e-15, seed=1)
        white = np.random.default_rng(1).standard_normal(clean.t.size)
        x = step * np.round(np.asarray(clean.x) / step + shift + dither * white)
        found = fit(Trace(clean.t, x), machine(Coulomb(0.02), load=1.89), MACHINE)
        assert_true(found, {**TRUE, "mu": 0.01})
        assert found.chi2_reduced == pytest.approx(1.0, abs=0.05)

    def test_noise_may_differ_from_sample_to_sample(self, run, plain):
        sigma = np.where(np.arange(run.n) < 700, 1e-9, 1e-6)
        found = fit(Trace(run.t, run.x, sigma=sigma), machine(), MACHINE)
        assert_true(found)
        assert found.std_errors["mu"] > 1.05 * plain.std_errors["mu"]

    def test_errors_grow_with_noise_larger_than_stated(self, run, plain):
        found = fit(Trace(run.t, run.x, sigma=1e-10), machine(), MACHINE)
        assert found.converged and found.chi2_reduced > 50
        for name in found.names:
            assert found.std_errors[name] == pytest.approx(plain.std_errors[name], rel=0.05)
            assert found.white_std_errors[name] < 0.2 * found.std_errors[name]
        assert any("The noise is larger than stated" in sentence for sentence in found.warnings)

    def test_information_criteria_count_parameters_and_samples(self, plain):
        n, p = plain.dof + 6, 6
        assert plain.aicc == pytest.approx(plain.chi2 + 2 * p + 2 * p * (p + 1) / (n - p - 1))
        assert plain.bic == pytest.approx(plain.chi2 + p * np.log(n))

    @pytest.mark.slow
    def test_what_hardly_changes_the_motion_is_flagged(self):
        """Fit v_stribeck with almost equal static and dynamic coefficients."""
        # With this noise the first mesh is fine enough; a finer one would compile another program.
        found = fit(coulomb_run(noise=1e-7), machine(Stribeck(0.02, 0.021, 5e-3)), (*MACHINE, "mu_s", "v_stribeck"))
        assert abs(found.values["mu_s"] - found.values["mu"]) < 4 * found.std_errors["mu_s"]
        assert found.flags["v_stribeck"] == ("hardly determined",) and not found.flags["mu"]


class TestPriorsAndBounds:
    @pytest.mark.parametrize("share", [0.3, 1.0])
    def test_a_prior_joins_like_a_further_measurement(self, run, plain, share):
        """Compare with Kalman's update.

        For a linear model, it gives mean and covariance with a prior.
        """
        std = share * plain.std_errors["damping"]
        mean = plain.values["damping"] + 3 * plain.std_errors["damping"]
        found = fit(run, machine(), MACHINE, priors={"damping": (mean, std)})
        column = plain.covariance[:, 1]
        gain = column / (column[1] + std**2)
        expected = np.array([plain.values[n] for n in plain.names]) + gain * (mean - plain.values["damping"])
        covariance = plain.covariance - np.outer(gain, column)
        values = np.array([found.values[n] for n in found.names])
        assert np.all(np.abs(values - expected) < 1e-2 * np.sqrt(np.diag(plain.covariance)))
        assert np.sqrt(np.diag(found.covariance)) == pytest.approx(np.sqrt(np.diag(covariance)), rel=1e-3)

    def test_a_prior_may_be_a_calibrated_value(self, run, plain):
        found = fit(run, machine(), MACHINE, priors={"damping": Measured(0.2, 1e-9)})
        assert found.values["damping"] == pytest.approx(0.2, abs=1e-8)

    def test_release_times_are_those_of_the_record_in_priors_and_bounds(self, run, plain):
        at = plain.values["t_release"]
        free = fit(
            run, machine(), MACHINE, bounds={"t_release": (at - 1e-3, at + 1e-3)}, priors={"t_release": (at, 1.0)}
        )
        assert free.values["t_release"] == pytest.approx(at, abs=1e-12)
        held = fit(run, machine(), MACHINE, bounds={"t_release": (at + 1e-6, None)})
        assert held.values["t_release"] == pytest.approx(at + 1e-6, abs=1e-12)
        assert held.flags["t_release"] == ("at bound",)

    def test_an_active_bound_is_reported(self, run, plain):
        found = fit(run, machine(), MACHINE, bounds={"damping": (0.3, None)})
        assert found.status.startswith("does not describe: damping beyond its bound would") and not found.described
        assert found.values["damping"] == 0.3 and found.flags["damping"] == ("at bound",)
        assert found.std_errors["damping"] == np.inf
        assert np.all(np.isfinite(np.delete(np.delete(found.covariance, 1, 0), 1, 1)))
        held = fit(run, machine(damping=0.3), ("mu", "stiffness"))
        assert found.values["mu"] == pytest.approx(held.values["mu"], rel=1e-7)
        assert found.std_errors["mu"] == pytest.approx(held.std_errors["mu"], rel=1e-5)

    def test_an_inactive_bound_changes_nothing(self, run, plain):
        found = fit(run, machine(), MACHINE, bounds={"damping": (0.0, 1.0), "mu": (0.01, 0.2)})
        assert found.values["mu"] == pytest.approx(plain.values["mu"], abs=1e-4 * plain.std_errors["mu"])
        assert found.status == "described"

    def test_negative_damping_is_never_described(self):
        found = fit(coulomb_run(zeta=-0.0027), machine(), MACHINE)
        assert_true(found, {**TRUE, "damping": -PROTOTYPE_DAMPING})
        assert "damping is negative by" in found.status and not found.described
        bounded = fit(coulomb_run(zeta=-0.0027), machine(), MACHINE, bounds={"damping": (0, None)})
        assert bounded.values["damping"] == 0.0 and not bounded.described


class TestSums:
    @pytest.mark.slow
    def test_a_dotted_name_and_a_tie(self, run, plain):
        two = machine(Coulomb(0.02) + Coulomb(0.03))
        free, tie = ("friction.0.mu", "damping", "stiffness"), {"friction.1.mu": ("friction.0.mu", 0.5)}
        tied = fit(run, two, free, tie=tie)
        assert tied.names[0] == "friction.0.mu" and tied.engine == "tables"
        assert tied.values["friction.0.mu"] == pytest.approx(plain.values["mu"] / 1.5, rel=1e-7)
        assert tied.std_errors["friction.0.mu"] == pytest.approx(plain.std_errors["mu"] / 1.5, rel=1e-4)
        first, second = tied.oscillator.friction.laws  # type: ignore[attr-defined]
        assert float(second.mu) == pytest.approx(0.5 * float(first.mu))
        assert tied.chi2 == pytest.approx(plain.chi2, abs=0.1)

    @pytest.mark.slow
    def test_two_equal_laws_are_undetermined(self, run):
        two = machine(Coulomb(0.02) + Coulomb(0.03))
        free = ("friction.0.mu", "friction.1.mu", "damping")
        found = fit(run, two, free, throw=False)
        assert not found.described
        assert found.status.startswith("undetermined: the record does not determine friction.0.mu, friction.1.mu.")
        for name in free[:2]:
            assert found.flags[name][0] == "undetermined" and found.std_errors[name] == np.inf
        assert np.isfinite(found.std_errors["damping"])
        with pytest.raises(FitError, match="not valid, undetermined") as caught:
            fit(run, two, free)
        assert isinstance(caught.value.fit, Fit) and not caught.value.fit.described


class TestSeveralRuns:
    @pytest.mark.slow
    def test_two_runs_share_the_machine(self, plain):
        runs = [coulomb_run(), Record(coulomb_run(2.5e-3, seed=5, offset=3e-4))]
        found = fit(runs, machine(), MACHINE)
        assert found.names[3:] == ("t_release[0]", "x0[0]", "offset[0]", "t_release[1]", "x0[1]", "offset[1]")
        assert_true(found, {**TRUE, "offset[0]": 0.0, "offset[1]": 3e-4})
        assert found.std_errors["mu"] < 0.8 * plain.std_errors["mu"]
        assert len(found.residuals) == len(found.times) == len(found.half_cycles) == 2
        for i in range(2):
            seen = np.isfinite(found.residuals[i])
            trace = runs[i] if isinstance(runs[i], Trace) else runs[i].trace
            model = found.predict(found.times[i][seen], run=i)
            assert found.residuals[i][seen] == pytest.approx(np.asarray(trace.x)[seen] - model, abs=1e-14)


class TestFailure:
    def test_a_model_that_is_not_finite_is_said_to_be_so(self, run):
        failed = fit(run, machine(damping=1e5), ("mu", "stiffness"), throw=False)  # overdamped: no half-cycles
        assert not failed.described
        assert failed.status.startswith("not finite: the model fails at the start values.")
        assert all(std == np.inf for std in failed.std_errors.values())
        assert "at start value" in failed.flags["x0"]
        assert "not finite" in failed.summary()

    def test_it_raises_with_the_fit_in_hand(self, run):
        with pytest.raises(FitError, match="The fit is not valid, not finite") as caught:
            fit(run, machine(damping=1e5), ("mu", "stiffness"))
        assert caught.value.fit.names == ("mu", "stiffness", "t_release", "x0", "offset")


class TestHalfCycles:
    @pytest.mark.parametrize("wrong", [-1, 1])
    def test_a_miscounted_record_is_repaired(self, run, plain, monkeypatch, wrong):
        counted = window._half_cycles
        monkeypatch.setattr(window, "_half_cycles", lambda *args: counted(*args) + wrong)
        found = fit(run, machine(), MACHINE)
        assert found.half_cycles == plain.half_cycles == (4,)
        assert found.values["mu"] == pytest.approx(plain.values["mu"], abs=1e-3 * plain.std_errors["mu"])
        assert found.chi2 == pytest.approx(plain.chi2, abs=1e-3)

    @pytest.mark.slow
    def test_static_friction_is_bracketed(self):
        """Check that every bracket contains the truth.

        The intersection of all brackets is narrower.
        """
        rng, mu_s = np.random.default_rng(11), 0.065
        narrow = []
        for x0 in rng.uniform(0.9e-3, 2.6e-3, 12):
            decay = coulomb_run(float(x0), mu_s=mu_s)
            found = fit(decay, machine(Coulomb(0.05, 0.05)), ("mu", "mu_s"), start="release", nuisance=("x0",))
            low, high = found.intervals["mu_s"]
            assert low <= mu_s <= high
            assert found.values["mu_s"] == pytest.approx((low + high) / 2)
            assert float(found.oscillator.friction.mu_s) == found.values["mu_s"]  # type: ignore[attr-defined]
            assert found.flags["mu_s"] == ("bracketed, not fitted",) and "mu_s" not in found.std_errors
            narrow.append((low, high))
        lows, highs = zip(*narrow, strict=True)
        assert min(highs) - max(lows) < 0.02 and max(lows) <= mu_s <= min(highs)

    @pytest.mark.slow
    def test_static_friction_is_bracketed_beside_quadratic_drag(self):
        """Bracket mu_s for a sum with quadratic drag.

        Only the Coulomb law holds the mass, so its bracket must be the same without drag.
        """
        alone = fit(coulomb_run(mu_s=0.065), machine(Coulomb(0.05, 0.05)), ("mu", "mu_s", "stiffness"))
        law = Coulomb(0.05, 0.05) + QuadraticDrag(0.0)
        found = fit(coulomb_run(mu_s=0.065), machine(law), ("mu", "mu_s", "stiffness"))
        assert found.intervals["mu_s"] == pytest.approx(alone.intervals["mu_s"], rel=1e-6)
        assert found.intervals["mu_s"][0] <= 0.065 <= found.intervals["mu_s"][1]


@pytest.mark.slow
def test_a_held_frequency_is_warned_of(run, plain):
    held = fit(run, machine(), ("mu", "damping"), throw=False)
    assert any("natural frequency is fixed" in sentence for sentence in held.warnings)
    assert not any("natural frequency" in sentence for sentence in plain.warnings)


def test_a_fitted_release_transient_is_named():
    """Fit from a slow release of the magnet and expect a warning."""
    truth = machine()
    record = synthetic_run(truth, X0, rate=10e3, duration=0.29842, hold=0.01, release_time_constant=1e-3, noise=1e-9)
    found = fit(record, truth, MACHINE, start="release", throw=False)
    assert any("The window includes the release" in sentence for sentence in found.warnings)
    assert not any("release" in sentence for sentence in fit(record, truth, MACHINE).warnings)


def test_a_stop_just_before_the_end_of_the_record_is_found():
    mu = 0.026692
    record = synthetic_run(machine(Coulomb(mu)), X0, rate=5e3, duration=0.4, noise=1e-9)
    assert segment_record(record).rest is None
    found = fit(record, machine(), MACHINE)
    assert found.chi2_reduced == pytest.approx(1, abs=0.15)
    assert_true(found, {**TRUE, "mu": mu})
