"""Noise models by name and robust standard errors.

The references are known noise and the scatter of many fits.
"""

import numpy as np
import pytest
from scipy.signal import lfilter

import fricjax as fj
from fricjax.errors import UsageError

pytestmark = pytest.mark.slow

MU = 0.02
MACHINE = fj.Oscillator(0.41068, 2574.0, 0.1756, 1.89, fj.friction.Coulomb(MU))
FREE = ("mu", "damping", "stiffness")
T = np.arange(6000) / 4e3


def coloured(seed):
    """Decay of some 35 half-cycles with AR(1) noise of coefficient 0.9."""
    rng = np.random.default_rng(seed)
    clean = np.asarray(fj.simulate(MACHINE, rng.uniform(1.5e-3, 2.5e-3), T).x)
    return T, clean + lfilter([1.0], [1.0, -0.9], 20e-9 * rng.standard_normal(T.size))


@pytest.fixture(scope="module")
def fits():
    return {noise: fj.fit(coloured(0), MACHINE, FREE, noise=noise) for noise in ("auto", "white", "autoregressive")}


def test_a_name_takes_the_place_of_what_the_record_shows(fits):
    assert fits["white"].std_errors == fits["white"].white_std_errors or fits["white"].noises[0].excess > 1
    assert fits["white"].noises[0].memory == 0 < fits["autoregressive"].noises[0].memory
    assert fits["autoregressive"].values["mu"] == pytest.approx(fits["auto"].values["mu"], abs=1e-9)
    assert fits["auto"].std_errors["mu"] > 2 * fits["white"].std_errors["mu"]
    assert fits["white"].noise == "white" and "noise model white" in fits["white"].summary()


def test_the_likelihood_finds_the_noise(fits):
    models = fj.uncertainty.noise_models(fits["auto"])
    assert models.best.name in ("autoregressive", "coloured")
    by_name = {row.name: row for row in models.rows}
    assert by_name["white"].bic > 1000 and by_name["autoregressive"].bic == models.best.bic == 0
    # The models do not depend on the noise model of the fit.
    again = fj.uncertainty.noise_models(fits["white"])
    assert [row.name for row in again.rows] == [row.name for row in models.rows]
    assert again.best.fit.values["mu"] == pytest.approx(models.best.fit.values["mu"], abs=1e-9)
    assert "Noise models, less the best" in models.summary() and models.plot().get_axes()


def test_of_white_noise_the_white_model_is_the_best():
    run = fj.synthetic_run(MACHINE, 2e-3, rate=4e3, duration=1.5, noise=5e-9, seed=3)
    models = fj.uncertainty.noise_models(fj.fit(run, MACHINE, FREE))
    assert models.best.name == "white" and "white" in models.described


def test_the_likelihood_of_a_process_is_that_of_its_covariance():
    """Compare -2 log L of AR(1) rows with the full covariance matrix."""
    from fricjax.estimation.colour import Series, autoregressive, process_of_noise, whitened

    rng, n = np.random.default_rng(1), 400
    noise = np.asarray(lfilter([1.0], [1.0, -0.6], rng.standard_normal(n)))
    series = Series(np.arange(n) / 1e3, noise, np.zeros((n, 1)), np.ones(n), np.zeros(1, int), np.zeros((n, 0)))
    colour = autoregressive(series)
    assert process_of_noise(series, 1.0) is not None and colour.coefficients.size == 1
    a = float(colour.coefficients[0])
    covariance = colour.std**2 / (1 - a**2) * a ** np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    expected = noise @ np.linalg.solve(covariance, noise) + np.linalg.slogdet(covariance)[1]
    white, _ = whitened(series, colour)
    assert white @ white + colour.log_determinant == pytest.approx(expected, rel=1e-9)


def test_a_saved_fit_remembers_its_noise_model(fits, tmp_path):
    assert fj.load_fit(fits["white"].save(tmp_path / "fit.json")).noise == "white"


def test_a_batch_takes_the_same_names(fits):
    batch = fj.fit_batch([coloured(0)], MACHINE, FREE, noise="white")
    assert batch.std_errors["mu"][0] == pytest.approx(fits["white"].std_errors["mu"], rel=1e-3)
    with pytest.raises(UsageError, match=r"no noise model 'whit'\. Did you mean 'white'\? Choose one of auto, white"):
        fj.fit_batch([coloured(0)], MACHINE, FREE, noise="whit")


def test_the_sandwich_covers_where_the_plain_error_does_not():
    """Compare the scatter of 24 least-squares fits with robust errors.

    The noise is AR(1) with coefficient 0.9.
    """
    scores = []
    for seed in range(24):
        fit = fj.fit(coloured(seed), MACHINE, FREE, noise="white")
        robust = fj.uncertainty.sandwich(fit)
        off = fit.values["mu"] - MU
        scores.append([off / fit.std_errors["mu"], off / robust.std_errors["mu"]])
    plain, sandwich = np.sqrt(np.mean(np.square(scores), axis=0))
    # The root mean square of 24 values has a standard deviation of 14 %.
    assert plain > 2.2 and 0.6 < sandwich < 1.5
    assert robust.doubted and "does not hold" in robust.summary()
    assert robust.plot().get_axes()[0].get_xlabel() == "Standard error over that of the fit [1]"


def test_beside_the_right_noise_the_sandwich_agrees(fits):
    robust = fj.uncertainty.sandwich(fits["auto"])
    assert not robust.doubted and robust.ratios["mu"] == pytest.approx(1.0, abs=0.35)
    blocks = fj.uncertainty.bootstrap(fits["auto"], 40)
    assert "Bootstrap" in fj.uncertainty.sandwich(fits["auto"], blocks).summary()


def test_a_robust_loss_has_no_likelihood():
    run = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=5e-9, seed=3)
    fit = fj.fit(run, MACHINE, FREE, loss="huber")
    for check in (fj.uncertainty.sandwich, fj.uncertainty.noise_models):
        with pytest.raises(UsageError, match="loss='squares'"):
            check(fit)
