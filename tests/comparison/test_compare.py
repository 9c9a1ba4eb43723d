"""Comparison of friction laws.

The tests check criteria by their formulas, held-out runs by explicit fits, and the ranking of the right law.
"""

import json

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import least_squares

from fricjax import Oscillator, Trace, compare, fit
from fricjax.comparison import cross_validation
from fricjax.comparison.candidates import identifiable_coefficients
from fricjax.errors import DataError, UsageError
from fricjax.friction import Coulomb, Dahl, LuGre, QuadraticDrag, Stribeck, Tanh
from tests.fitting.test_whiteness import autoregressive
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import STIFFNESS, coulomb_run
from tests.oracles import coulomb_viscous

LOAD, MU, NOISE = 9.66, 0.02, 1e-9
RUN = {"mu": MU, "rate": 2500, "samples": 1200, "noise": NOISE}
# Damping known, damping free, and damping fixed at a wrong value.
FREE = (["mu", "stiffness"], ["mu", "damping", "stiffness"], ["mu", "stiffness"])
NAMES = ("known", "free", "wrong")


def machine(law, damping=PROTOTYPE_DAMPING):
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, damping, LOAD, law)


MACHINES = [machine(Coulomb(MU)), machine(Coulomb(MU)), machine(Coulomb(MU), 1.05 * PROTOTYPE_DAMPING)]
RUNS = [coulomb_run(x0, seed=seed, **RUN) for seed, x0 in enumerate((1.6e-3, 1.75e-3))]


@pytest.fixture(scope="module")
def joint():
    """Compare known damping with a wrong fixed damping, on two runs."""
    return compare(RUNS, MACHINES[::2], FREE[::2], names=NAMES[::2])


@pytest.fixture(scope="module")
def single():
    return compare(RUNS[0], MACHINES, FREE, names=NAMES)


@pytest.mark.slow
def test_the_simplest_right_law_comes_first(joint, single):
    assert single.ranking == ("known", "free", "wrong")
    assert joint.ranking == ("known", "wrong")
    assert single.best.names[:2] == joint.best.names[:2] == ("mu", "stiffness")
    for found in (joint, single):
        assert found.row("known").tests.failed == ()
        assert {"white", "signs"} <= set(found.row("wrong").tests.failed)
        assert not found.fingerprints
    assert repr(single) == "Comparison(known < free < wrong by bic)"


def test_criteria_by_their_formulas(joint, single):
    for found, nuisances in ((joint, 6), (single, 3)):
        fits = {name: np.hstack(one.residuals) for name, one in found.fits.items()}
        n = found.n_samples
        assert n == np.isfinite(fits["known"]).sum()
        # The residuals are white, but their scatter may exceed the stated noise by chance.
        least = min(found.rows, key=lambda row: row.chi2)
        assert (found.n_effective, found.inflation) == (n, max(least.chi2_reduced, 1.0))
        for row in found.rows:
            k, chi2 = row.n_parameters, np.nansum((fits[row.name] / NOISE) ** 2) / found.inflation
            assert k == len(row.free) + nuisances
            assert row.bic == pytest.approx(chi2 + k * np.log(n), rel=1e-9)
            assert row.aicc == pytest.approx(chi2 + 2 * k * n / (n - k - 1), rel=1e-9)


def closed_form(found, t, own):
    """Displacement of the fitted machine in closed form, without this package.

    `own` holds time, position and offset of the turning point at the start.
    """
    kin = found.kinematics
    start, x0, offset = own
    settings = {"frequency": kin["natural_frequency"].value, "zeta": kin["damping_ratio"].value}
    return coulomb_viscous(
        t, x0 + offset, offset=offset, release=start, dead_band=kin["dead_band"].value, **settings
    ).x  # fmt: skip


def refitted(found, run, own, used):
    """Sum of squares of a run under a fitted machine.

    Start and offset of the run are fitted, from the guess `own`.
    """
    t, x = np.asarray(RUNS[run].t), np.asarray(RUNS[run].x)
    scale = np.array([1e-6, 1e-8, 1e-8])

    def miss(steps):
        return (closed_form(found, t, own + scale * steps) - x)[used] / NOISE

    return 2 * least_squares(miss, np.zeros(3), xtol=1e-14, ftol=1e-14).cost


def test_the_score_of_held_out_runs_is_that_of_explicit_fits(joint):
    for name, model in (("known", MACHINES[0]), ("wrong", MACHINES[2])):
        chi2 = count = 0
        for run, other in ((0, 1), (1, 0)):
            used = np.isfinite(joint.fits[name].residuals[run])
            own = np.array([joint.fits[name].run_parameter(key, run) for key in ("t_release", "x0", "offset")])
            chi2 += refitted(fit(RUNS[other], model, FREE[0]), run, own, used)
            count += used.sum()
        assert joint.row(name).held_out == pytest.approx(chi2 / count, rel=1e-4)


@pytest.mark.slow
def test_the_score_of_a_single_run_predicts_its_last_third(single):
    for name, model in (("known", MACHINES[0]), ("wrong", MACHINES[2])):
        found = single.fits[name]
        t, used = np.asarray(RUNS[0].t), np.isfinite(found.residuals)
        decay = coulomb_viscous(t, 1.6e-3, frequency=12.6, zeta=0.0027, dead_band=MU * LOAD / STIFFNESS)
        split = decay.stops[0] + 2 / 3 * (decay.stops[-1] - decay.stops[0])
        first = fit(Trace(t, RUNS[0].x, sigma=NOISE, mask=t <= split), model, FREE[0])
        predicted = closed_form(first, t, [first.run_parameter(key) for key in ("t_release", "x0", "offset")])
        rest = used & (t > split)
        expected = np.mean(((predicted - np.asarray(RUNS[0].x))[rest] / NOISE) ** 2)
        assert single.row(name).held_out == pytest.approx(expected, rel=0.02)


@pytest.mark.slow
def test_coloured_noise_counts_fewer_samples(single):
    phi = 0.6
    clean = coulomb_run(1.6e-3, **{**RUN, "noise": 1e-15})
    ratios, passed = [], 0
    for seed in range(6):
        x = np.asarray(clean.x) + 2 * NOISE * autoregressive(phi, RUN["samples"], seed)
        found = compare(Trace(clean.t, x, sigma=NOISE), MACHINES, FREE, names=NAMES, held_out=seed == 0)
        ratios.append(found.n_samples / found.n_effective)
        assert found.inflation >= 3.5 * ratios[-1]
        assert "not white" in found.summary() and "No law describes" not in found.summary()
        # No law is rejected because the noise is larger than stated.
        assert found.row("known").chi2_reduced == pytest.approx(1, abs=0.2)
        assert seed or found.row("known").held_out == pytest.approx(1, abs=0.5)
        # The residual tests apply to the whitened residuals.
        right, wrong = found.row("known").tests, found.row("wrong").tests
        assert right is not None and wrong is not None
        passed += right.failed == ()
        assert set(wrong.failed) >= {"white", "signs"}
    assert passed >= 5
    assert np.mean(ratios) == pytest.approx((1 + phi) / (1 - phi), rel=0.25)
    assert single.n_effective == single.n_samples


def test_noise_to_be_estimated_ranks_the_same(single):
    scaled = Trace(RUNS[0].t, RUNS[0].x, sigma=7 * NOISE)
    for mode in ("scale", "estimate"):
        found = compare(scaled, MACHINES, FREE, names=NAMES, held_out=False, sigma_mode=mode)
        distances = [found.row(name).bic - found.row("known").bic for name in NAMES]
        expected = [single.row(name).bic - single.row("known").bic for name in NAMES]
        assert distances == pytest.approx(expected, rel=0.1, abs=0.1)


def test_a_fit_that_fails_is_a_row(single):
    found = compare(RUNS[0], [MACHINES[0], MACHINES[0]], [["mu", "stiffness"], ["mu", "sigma0"]], held_out=False)
    row = found.row("Coulomb 2")
    assert row.status.startswith("rejected: This oscillator has no coefficient 'sigma0'")
    assert found.ranking == ("Coulomb 1", "Coulomb 2")
    assert "Coulomb 2 is not valid, rejected" in found.summary()
    assert found.row("Coulomb 1").chi2 == pytest.approx(single.row("known").chi2, rel=1e-9)
    json.dumps(found.to_dict(), default=str)
    assert len(found.plot().axes) == 1


def test_how_it_looks(joint, single):
    text = single.summary()
    assert "known describes the runs best: BIC of free is larger by" in text
    assert text.index("known") < text.index("free") < text.index("wrong")
    assert "<table>" in single._repr_html_()
    assert [axes.get_ylabel().split("\n")[0] for axes in joint.plot(1).axes] == ["known", "wrong"]
    told = single.to_dict()
    assert (told["best"], told["rows"][1]["name"], told["criterion"]) == ("known", "free", "bic")
    assert told["rows"][0]["values"]["mu"] == pytest.approx(MU, rel=1e-5)


@pytest.mark.parametrize(
    ("law", "expected"),
    [
        (Coulomb(0.1, 0.12), ("mu",)),
        (Tanh(0.1, 1e-4), ("mu",)),
        (Stribeck(0.1), ("mu",)),
        (Stribeck(0.1, 0.1), ("mu", "mu_s", "v_stribeck")),
        (LuGre(0.1), ("mu", "sigma0", "sigma1")),
        (LuGre(0.1, 0.13), ("mu", "mu_s", "v_stribeck", "sigma0", "sigma1")),
        (Dahl(0.1, 1e5), ("mu", "sigma0")),
        (Coulomb(0.1) + QuadraticDrag(0.0), ("mu", "quadratic_drag")),
    ],
)
def test_what_is_free_by_default(law, expected):
    assert identifiable_coefficients(machine(law)) == (*expected, "damping", "stiffness")


def test_all_laws_see_the_same_samples():
    from fricjax.comparison.candidates import candidates

    laws = [machine(Coulomb(MU)), machine(Tanh(MU, 1e-4)), machine(LuGre(MU))]
    entered = candidates([RUNS[0]], laws, None, None, {})
    used = [candidate.windows[0].used for candidate in entered if isinstance(candidate.windows, tuple)]
    assert used[0].sum() == used[1].sum() == used[2].sum() > 0
    # If one of the laws creeps, the time at rest is left out.
    (alone,) = candidates([RUNS[0]], laws[:1], None, None, {})
    assert isinstance(alone.windows, tuple)
    assert used[0].sum() < alone.windows[0].used.sum()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"criterion": "aic"}, "no ranking by 'aic'. Did you mean 'aicc'?"),
        ({"criterion": "held_out", "held_out": False}, "no ranking by 'held_out'"),
        ({"names": ["one"]}, "3 oscillators but 1 names"),
        ({"names": ["a", "a", "b"]}, "not all different"),
        ({"free": [["mu"]]}, "3 oscillators but 1 lists"),
        ({"bounds": {"sigma9": (0, 1)}}, "bounds names 'sigma9', which no candidate has"),
        ({"sigma_mode": "relative"}, "no sigma_mode"),
        ({"bonds": {}}, r"compare has no setting 'bonds'. Did you mean 'bounds'\?"),
        ({"throw": False}, "compare has no setting 'throw'"),
    ],
)
def test_wrong_arguments(arguments, words):
    with pytest.raises(UsageError, match=words):
        compare(RUNS[0], MACHINES, **{"free": FREE, **arguments})  # pyright: ignore[reportArgumentType]


def test_nothing_to_compare():
    with pytest.raises(UsageError, match="list of oscillators"):
        compare(RUNS[0], MACHINES[0])  # pyright: ignore[reportArgumentType]
    with pytest.raises(DataError, match="constant"):
        compare(Trace(RUNS[0].t, jnp.zeros(1200)), MACHINES, FREE)


@pytest.mark.slow
def test_falling_friction_is_told_from_constant_friction(monkeypatch):
    from fricjax import synthetic_run

    true = machine(Stribeck(MU, 1.3 * MU, v_stribeck=5e-3))
    run = synthetic_run(true, 1.9e-3, rate=2500.0, duration=0.62, noise=5e-9, seed=1)
    found = compare(run, [machine(Coulomb(MU)), machine(Stribeck(MU, 1.3 * MU, v_stribeck=4e-3))])
    assert found.ranking == ("Stribeck", "Coulomb")
    assert found.best.values["v_stribeck"] == pytest.approx(5e-3, abs=5 * found.best.std_errors["v_stribeck"])
    assert any(sentence.startswith("Falling friction") for sentence in found.fingerprints)
    # The prediction of the last strokes includes the uncertainty of mu_s and v_stribeck after the first part.
    score = found.row("Stribeck").held_out
    assert score < 1e-2 * found.row("Coulomb").held_out
    for factor in (0.5, 2.0):
        monkeypatch.setattr(cross_validation, "_NEAR", 0.3 * factor)
        again = compare(run, [machine(Stribeck(MU, 1.3 * MU, v_stribeck=4e-3))])
        assert again.row("Stribeck").held_out == pytest.approx(score, rel=1e-3)
