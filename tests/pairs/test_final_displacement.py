"""Route 2 against the half-cycle map, also with unknown numbers of half-cycles."""

import jax
import numpy as np
import pytest
import scipy.signal
from hypothesis import given, settings
from hypothesis import strategies as st

import fricjax as fj
from fricjax.errors import DataError, UsageError
from fricjax.pairs import fit_final_displacements, fit_triangle_map, pairs_of
from tests.compilations import compilations
from tests.pairs.campaigns import BAND, DAMPED, DAMPING, LOAD, MASS, MU, STIFFNESS, campaign, machine, released

STARTS = np.linspace(0.25e-3, 2e-3, 36)


def test_exact_pairs_give_mu_offset_and_counts_to_rounding():
    xf, counts = campaign(STARTS, offset=3e-6)
    found = fit_final_displacements(STARTS, xf, machine())
    assert found.converged
    assert found.values["mu"] == pytest.approx(MU, rel=1e-10)
    assert found.values["offset"] == pytest.approx(3e-6, abs=1e-14)
    assert np.array_equal(found.half_cycles, counts)
    assert found.extras["dead_band"].value == pytest.approx(BAND, rel=1e-10)


def test_the_slope_by_mu_is_that_of_the_map():
    """Compare the standard error with its closed form.

    For a given sigma, it is sigma over the norm of (1 + rho) S_n N/k.
    """
    xf, counts = campaign(STARTS)
    found = fit_final_displacements(STARTS, xf, machine(), nuisance=(), sigma=1e-9)
    slopes = (1 + DAMPED) * (1 - DAMPED**counts) / (1 - DAMPED) * LOAD / STIFFNESS
    assert found.std_errors["mu"] == pytest.approx(1e-9 / np.linalg.norm(slopes), rel=1e-6)


@pytest.mark.slow
def test_damping_is_found_beside_mu():
    xf, _ = campaign(STARTS)
    found = fit_final_displacements(STARTS, xf, machine(damping=1.2 * DAMPING), ["mu", "damping"])
    assert found.values["damping"] == pytest.approx(DAMPING, rel=1e-7)
    assert found.values["mu"] == pytest.approx(MU, rel=1e-8)


@pytest.mark.slow
def test_standard_errors_are_honest():
    """Check for unit variance of mu in standard errors over many campaigns."""
    random, xf = np.random.default_rng(0), campaign(STARTS, offset=3e-6)[0]
    pulls = []
    for _ in range(60):
        found = fit_final_displacements(STARTS, xf + 2e-9 * random.standard_normal(36), machine(), sigma=2e-9)
        pulls.append((found.values["mu"] - MU) / found.std_errors["mu"])
    assert np.std(pulls) == pytest.approx(1, abs=0.3)
    assert abs(np.mean(pulls)) < 0.5


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    mu=st.floats(0.01, 0.1),
    excess=st.floats(1.0, 1.5),
    offset=st.floats(-1e-5, 1e-5),
)
def test_any_campaign_is_unwrapped(seed: int, mu: float, excess: float, offset: float):
    """Use pairs of both signs, in any order, with any static friction."""
    random, band = np.random.default_rng(seed), mu * LOAD / STIFFNESS
    x0 = random.uniform(1.5, 12, 24) * band * random.choice([-1.0, 1.0], 24)
    xf = np.array([released(x - offset, band, excess * band)[0] + offset for x in x0])
    found = fit_final_displacements(x0, xf, machine())
    assert found.values["mu"] == pytest.approx(mu, rel=1e-8)
    low, high = found.intervals["mu_s"]
    assert low - 1e-9 <= excess * mu <= high + 1e-9


def test_a_scatter_of_mu_weighs_long_runs_less():
    random = np.random.default_rng(3)
    bands = BAND * (1 + 0.02 * random.standard_normal(36))
    xf = np.array([released(x, band, band)[0] for x, band in zip(STARTS, bands, strict=True)])
    found = fit_final_displacements(STARTS, xf, machine(), nuisance=(), mu_scatter=0.02)
    assert found.values["mu"] == pytest.approx(MU, rel=0.015)
    assert found.std_errors["mu"] == pytest.approx(0.02 * MU / np.sqrt(36), rel=0.15)
    assert 0.5 < found.chi2_reduced < 1.6


@pytest.mark.slow
def test_a_stribeck_law_is_fitted_too():
    law = fj.friction.Stribeck(MU, 0.06, v_stribeck=5e-3)
    truth = fj.Oscillator(MASS, STIFFNESS, DAMPING, LOAD, law)
    xf = np.asarray(jax.vmap(lambda x: fj.final_displacement(truth, x))(STARTS))
    begin = fj.Oscillator(MASS, STIFFNESS, DAMPING, LOAD, fj.friction.Stribeck(0.045, 0.06, v_stribeck=5e-3))
    found = fit_final_displacements(STARTS, xf, begin, ["mu"], nuisance=())
    assert found.values["mu"] == pytest.approx(MU, rel=1e-5)
    assert "mu_s" not in found.values


@pytest.mark.slow
@pytest.mark.parametrize("time_constant", [0.0, 3e-3])
def test_pairs_from_the_first_reversal_do_not_feel_the_release(time_constant: float):
    runs = [
        fj.synthetic_run(
            machine(MU), x, rate=10e3, duration=0.4, noise=1e-9, release_time_constant=time_constant, seed=i
        )
        for i, x in enumerate(np.linspace(0.9e-3, 2e-3, 6))
    ]
    pairs = pairs_of(runs)
    found = fit_final_displacements(pairs.x0, pairs.xf, machine(), half_cycles=pairs.half_cycles)
    assert found.values["mu"] == pytest.approx(MU, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("start", ["first_reversal", "release"])
@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_the_stated_errors_of_pairs_are_those_that_noise_makes(memory: float, start: str):
    """Compare noisy pairs with the pair of the motion without noise.

    The noise is white or autoregressive, with forty seeds.
    """
    clean = fj.synthetic_run(machine(MU), 2e-3, rate=2e3, duration=0.6, seed=0, hold=0.1)
    truth = pairs_of(fj.Record(clean.t, clean.x, sigma=1e-12), start=start)
    count = int(np.asarray(truth.half_cycles)[0])
    handed_on = (-1) ** count * np.exp(-DAMPING / (2 * MASS) * np.pi * np.sqrt(MASS / STIFFNESS) * count)
    errors, stated = [], []
    for seed in range(40):
        white = 1e-7 * np.sqrt(1 - memory**2) * np.random.default_rng(seed).standard_normal(clean.t.size + 200)
        noise = scipy.signal.lfilter([1.0], [1.0, -memory], white)[200:]
        pair = pairs_of((clean.t, clean.x + noise), start=start)
        errors.append(pair.xf[0] - truth.xf[0] - handed_on * (pair.x0[0] - truth.x0[0]))
        stated.append(np.asarray(pair.sigma)[0])
    assert 0.8 < np.median(stated) / np.std(errors) < 2.5


def test_the_report_and_the_picture(tmp_path):
    xf, _ = campaign(STARTS)
    found = fit_final_displacements(STARTS, xf + 1e-9 * np.random.default_rng(0).standard_normal(36), machine())
    assert "bracketed, not fitted" in found.summary() and "1 to 5 half-cycles" in found.summary()
    assert "<table>" in found._repr_html_()
    fj.show.save(found.plot(), tmp_path / "map.png")
    assert found.to_dict()["values"]["mu"] == found.values["mu"]


def test_a_second_fit_compiles_nothing():
    xf, _ = campaign(STARTS)
    fit_final_displacements(STARTS, xf, machine())
    with compilations() as made:
        fit_final_displacements(STARTS, xf + 1e-9, machine(0.04))
    assert made == []


class TestWhatCannotBe:
    """Error messages and warnings for pairs that cannot be fitted."""

    def test_arrays_that_do_not_fit(self):
        with pytest.raises(UsageError, match=r"equal length, got shapes \(3,\) and \(2,\)"):
            fit_final_displacements([1e-3, 2e-3, 3e-3], [0.0, 0.0], machine())

    def test_a_number_that_is_none(self):
        with pytest.raises(DataError, match=r"xf\[1\] is nan"):
            fit_final_displacements([1e-3, 2e-3], [0.0, np.nan], machine())

    def test_releases_inside_the_dead_band(self):
        with pytest.raises(DataError, match="The mass did not complete a half-cycle in any pair"):
            fit_final_displacements([1e-4, 1.5e-4], [1e-4, 1.5e-4], machine(), half_cycles=[0, 0])

    def test_one_pair_and_two_unknowns(self):
        with pytest.raises(DataError, match=r"1 different pair\(s\) cannot determine 2 parameters"):
            fit_final_displacements([1e-3], campaign(np.array([1e-3]))[0], machine())

    def test_one_pair_and_one_unknown(self):
        found = fit_final_displacements([1e-3], campaign(np.array([1e-3]))[0], machine(), nuisance=(), half_cycles=[3])
        assert found.values["mu"] == pytest.approx(MU, rel=1e-9)
        assert any("gives no uncertainty" in sentence for sentence in found.warnings)
        assert found.std_errors["mu"] == np.inf and found.intervals["mu"][1] == np.inf

    def test_pairs_of_one_half_cycle(self):
        x0 = np.array([0.25e-3, 0.3e-3, 0.4e-3, 0.5e-3])
        xf, counts = campaign(x0)
        assert set(counts) == {1}
        found = fit_final_displacements(x0, xf, machine(), half_cycles=counts)
        assert not found.converged and "undetermined" in found.status
        assert any("two half-cycles or more" in sentence for sentence in found.warnings)

    @pytest.mark.slow
    def test_pairs_given_twice(self):
        x0 = np.tile(STARTS, 2)
        found = fit_final_displacements(x0, campaign(x0)[0], machine())
        assert any("36 pair(s) occur more than once" in sentence for sentence in found.warnings)

    def test_counts_that_are_none(self):
        with pytest.raises(UsageError, match=r"half_cycles\[1\] is -1"):
            fit_final_displacements([1e-3, 2e-3], [0.0, 0.0], machine(), half_cycles=[1, -1])

    def test_a_law_that_never_rests(self):
        tanh = fj.Oscillator(MASS, STIFFNESS, DAMPING, LOAD, fj.friction.Tanh(MU, 1e-4))
        with pytest.raises(UsageError, match="Under Tanh the mass does not rest"):
            fit_final_displacements(STARTS, campaign(STARTS)[0], tanh)

    def test_mu_s_alone(self):
        with pytest.raises(UsageError, match="mu_s alone cannot be fitted"):
            fit_final_displacements(STARTS, campaign(STARTS)[0], machine(MU, 0.06), ["mu_s"])

    def test_a_run_that_does_not_stop(self):
        moving = fj.synthetic_run(machine(MU), 2e-3, rate=10e3, duration=0.1, noise=1e-9)
        with pytest.raises(DataError, match="no final displacement of synthetic run, which does not come to rest"):
            pairs_of([moving])


RIG = fj.Rig(mass=MASS, stiffness=fj.Measured(STIFFNESS, 0.01 * STIFFNESS), damping=DAMPING, normal_force=LOAD)


class TestTriangleMap:
    """Tests of route 3: zeros, edges, heights and jumps of the map."""

    def test_zeros_give_mu_whatever_the_spacing(self):
        xf, _ = campaign(STARTS, offset=3e-6, static=1.1 * BAND)
        found = fit_triangle_map(STARTS, xf, RIG)
        assert found.values["mu"] == pytest.approx(MU, rel=1e-9)
        # A stiffer spring also makes the given damping a smaller fraction of critical damping.
        assert found.combined_std_errors["mu"] == pytest.approx(0.01 * MU, rel=1e-2)
        exact = RIG.replace(stiffness=STIFFNESS, displacement_scale=fj.Measured(1.0, 2e-3))
        assert fit_triangle_map(STARTS, xf, exact).combined_std_errors["mu"] == pytest.approx(2e-3 * MU, rel=1e-6)
        assert found.extras["height_of_line_intersections"].value == pytest.approx(BAND, rel=1e-8)
        low, high = found.intervals["mu_s"]
        assert low <= 1.1 * MU <= high
        width = (1 + DAMPED) * (high - low) * LOAD / STIFFNESS
        assert found.extras["jump"].value == pytest.approx((1 + DAMPED) * 0.1 * BAND, abs=width)

    def test_the_formula_without_damping_is_off_as_said(self):
        xf, _ = campaign(STARTS)
        found = fit_triangle_map(STARTS, xf, RIG)
        naive = found.extras["mu_from_period_without_damping"].value
        assert naive / MU - 1 == pytest.approx(found.extras["bias_of_that_by_damping"].value, rel=1e-6)
        assert naive / MU - 1 == pytest.approx(2.6e-2, abs=2e-3)

    def test_a_rig_without_damping_is_told(self):
        xf, _ = campaign(STARTS)
        found = fit_triangle_map(STARTS, xf, fj.Rig(mass=MASS, stiffness=STIFFNESS, normal_force=LOAD))
        assert any("no damping" in sentence for sentence in found.warnings)

    def test_no_segment(self):
        with pytest.raises(DataError, match="shows no zero"):
            fit_triangle_map([1e-4, 1.2e-4, 1.5e-4], [1e-4, 1.2e-4, 1.5e-4], RIG)
