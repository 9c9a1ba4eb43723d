"""Status of fits.

A fit is described only if its model describes the record. Every other outcome has a name.
"""

import re

import numpy as np
import pytest

from fricjax import Fit, Oscillator, Record, Trace, compare, fit, fit_batch, load_fit, multistart, read
from fricjax.friction import Coulomb
from fricjax.thresholds import DESCRIBED
from tests.machines import MACHINE, RIGS, STIFFNESS, coulomb_run, oscillator
from tests.oracles import coulomb_viscous

MODEL = oscillator(RIGS["sliding"], "Coulomb")
NOISE = 1e-9
# A fringe of a helium-neon laser, half its wavelength.
FRINGE = 316.4e-9
MISFIT = "does not describe: "


def altered(change, **settings) -> Trace:
    """Change the displacements of the noisy sliding run."""
    run = coulomb_run()
    return Trace(run.t, change(np.array(run.x)), **{"sigma": NOISE, **settings})


def slipped(at: int = 500, size: float = FRINGE, **settings) -> Trace:
    """Lose a fringe at sample `at`, in mid-stroke."""
    return altered(lambda x: np.where(np.arange(x.size) < at, x, x + size), **settings)


def reversed_in_time() -> Trace:
    return altered(lambda x: x[::-1])


def with_outliers() -> Trace:
    """Displace every hundredth sample by 100 um."""
    return altered(lambda x: x + 1e-4 * (np.arange(x.size) % 100 == 50))


def in_motion(found: Fit) -> float:
    """Root mean square of the residuals before the rest."""
    assert found.problem is not None
    return float(np.sqrt(np.mean(found.residuals[found.problem.windows[0].moving] ** 2)))


def assert_named(found: Fit, name: str, *parts: str):
    """Check a fit that found its optimum but is not described.

    `fit` returned it without `throw=False`.
    """
    assert not found.described and found.optimum_found
    assert found.status.startswith(name), found.status
    for part in parts:
        assert part in found.status
    assert found.status in found.summary()
    assert np.all(np.isfinite(list(found.values.values())))


def test_a_fringe_slip_has_not_converged():
    found = fit(slipped(), MODEL, MACHINE)
    assert found.chi2_reduced > 1e3
    assert_named(found, MISFIT, "repair of its slips would", "fit with repair='slips'")
    ((before, after),) = re.findall(r"\(([\d.]+) nm -> ([\d.]+) pm\)", found.status)
    assert float(before) * 1e-9 == pytest.approx(in_motion(found), rel=0.01)
    assert float(after) * 1e-12 == pytest.approx(NOISE, rel=0.03)
    assert sum("was tried" in told for told in found.warnings) == 1


def test_a_record_in_reversed_time_has_not_converged_and_is_recognised():
    found = fit(reversed_in_time(), MODEL, MACHINE)
    assert_named(found, "no free decay: growing")
    (sentence,) = (told for told in found.warnings if "The amplitude grows with time" in told)
    assert "is the time reversed, or is the mass driven?" in sentence
    # In the reversed record, the first stroke after the rest has 0.53 mm and the last one 3.62 mm.
    assert not any("grows" in told for told in fit(coulomb_run(), MODEL, MACHINE).warnings)


def test_a_bound_that_keeps_the_model_from_the_record_has_not_converged():
    found = fit(coulomb_run(), MODEL, MACHINE, bounds={"mu": (0.1, None)})
    assert found.chi2_reduced > 1e8 and found.values["mu"] == 0.1
    assert_named(found, MISFIT, "mu beyond its bound would", "fit with another bound of mu")


def test_a_bound_next_to_the_optimum_is_named():
    plain = fit(coulomb_run(), MODEL, MACHINE)
    bound = plain.values["damping"] + 2 * plain.std_errors["damping"]
    found = fit(coulomb_run(), MODEL, MACHINE, bounds={"damping": (bound, None)})
    assert found.chi2_reduced < 1.1
    assert_named(found, "at a bound: damping. Widen the bound, fix this parameter")


def deflected() -> Trace:
    """Add a smooth deviation of 100 nm that no term explains."""
    t = np.asarray(coulomb_run().t)
    wave = np.sin(2 * np.pi * (31.0 * t + 150.0 * t**2)) * np.exp(-(((t - 0.12) / 0.05) ** 2))
    return altered(lambda x: x + 1e-7 * wave)


@pytest.mark.parametrize(("multiple", "described"), [(0.95 * DESCRIBED, True), (1.05 * DESCRIBED, False)])
def test_the_multiple_of_the_noise_is_what_is_stated(multiple, described):
    """State a noise just above or below a tenth of the residuals."""
    run = deflected()
    sigma = in_motion(fit(run, MODEL, MACHINE)) / multiple
    found = fit(Trace(run.t, run.x, sigma=sigma), MODEL, MACHINE)
    assert in_motion(found) / sigma == pytest.approx(multiple, rel=1e-3)
    assert found.described == described and found.converged


@pytest.mark.parametrize("seed", [7, 55])
def test_values_that_were_repeated_are_no_noise(seed):
    """Refuse a record with dropouts and fit the repaired one.

    Without the check, zeros in the rest count as twelve half-cycles, and residuals of 6 um as slow noise.
    The fit would then converge with mu off by 70 standard errors.
    """
    t, random = np.arange(10000) / 8e3, np.random.default_rng(seed)
    machine = Oscillator(1.0, 5000.0, 2.5, 9.81, Coulomb(0.043))
    clean = coulomb_viscous(t, 0.5e-3, frequency=11.254, zeta=0.01768, dead_band=0.043 * 9.81 / 5000.0, release=0.2).x
    x = clean + 1e-6 * random.standard_normal(t.size)
    for first in random.integers(0, t.size, 2):
        x[first : first + random.integers(1, 80)] = 0.0
    found = fit((t, x), machine, MACHINE, throw=False)
    assert_named(found, MISFIT, "repair of its dropouts would", "repair='dropouts'")
    repaired = fit(read((t, x), repair="dropouts"), machine, MACHINE)
    assert abs(repaired.values["mu"] - 0.043) < 4 * repaired.std_errors["mu"]


@pytest.mark.parametrize("mode", ["scale", "estimate"])
def test_noise_that_is_only_relative_is_compared_with_what_the_record_shows(mode):
    assert fit(altered(lambda x: x, sigma=1.0), MODEL, MACHINE, sigma_mode=mode).converged
    assert_named(fit(slipped(sigma=1.0), MODEL, MACHINE, sigma_mode=mode), MISFIT, "repair of its slips would")


def test_a_noise_stated_too_small_is_no_misfit():
    found = fit(altered(lambda x: x, sigma=1e-11), MODEL, MACHINE)
    assert found.converged and found.chi2_reduced > 5e3
    assert any("The noise is larger than stated" in told for told in found.warnings)


def test_a_record_without_noise_is_described_by_its_model():
    """Fit a record without noise.

    The residuals are rounding errors, far larger than the noise that differences of the samples show.
    """
    t = np.arange(2000) / 5e3
    clean = coulomb_viscous(t, 2e-3, frequency=12.6, zeta=0.0027, dead_band=0.05 * 9.66 / STIFFNESS).x
    found = fit(Trace(t, clean), MODEL, MACHINE)
    assert found.converged and found.residual_rms < 1e-12


@pytest.mark.slow
def test_outliers_are_no_misfit_under_a_robust_loss():
    squares = fit(with_outliers(), MODEL, MACHINE)
    assert_named(squares, MISFIT, "less weight for outliers would", "loss='huber'")
    robust = fit(with_outliers(), MODEL, MACHINE, loss="cauchy")
    assert robust.converged and abs(robust.values["mu"] - 0.05) < 4 * robust.std_errors["mu"]
    assert not any("does not describe" in told for told in robust.warnings)
    clean = fit(coulomb_run(), MODEL, MACHINE)
    # With one outlier in a hundred, errors and criteria of the robust fit grow far less than those of least squares.
    assert robust.std_errors["mu"] < 1.2 * robust.white_std_errors["mu"] and not any(robust.flags.values())
    assert robust.aicc < clean.aicc + 0.01 * clean.dof * 2 * 2.385**2 * np.log(1e-4 / NOISE)
    # For normal noise this loss has an efficiency of 95 %.
    for mode in ("absolute", "scale"):
        told = fit(with_outliers(), MODEL, MACHINE, loss="cauchy", sigma_mode=mode)
        assert told.std_errors["mu"] == pytest.approx(clean.std_errors["mu"] / 0.95**0.5, rel=0.04)
    assert not fit(reversed_in_time(), MODEL, MACHINE, loss="cauchy", throw=False).described


@pytest.mark.slow
def test_of_several_runs_the_one_that_is_not_described_is_named():
    """Check the residuals of each run.

    The root mean square of all samples would hide one bad run.
    """
    runs = [coulomb_run(seed=seed) for seed in range(3)]
    found = fit([*runs, slipped(size=45e-9)], MODEL, MACHINE)
    assert found.residual_rms < DESCRIBED * NOISE
    assert_named(found, MISFIT, " in run 3 are ")


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
def test_a_batch_says_the_same():
    runs = [coulomb_run(), slipped(), reversed_in_time(), coulomb_run(seed=3)]
    batch = fit_batch(runs, MODEL, MACHINE)
    alone = [fit(run, MODEL, MACHINE) for run in runs]
    assert batch.described.tolist() == [found.described for found in alone] == [True, False, False, True]
    assert batch.optimum_found.tolist() == [True] * 4
    assert [status.split(":")[0] for status in batch.status] == [found.status.split(":")[0] for found in alone]
    assert batch.status[1] == alone[1].status
    assert any("The amplitude grows with time" in told for told in batch.warnings[2]) and not batch.warnings[0]
    table = batch.to_dataframe()
    assert table["converged"].tolist() == batch.converged.tolist()
    assert "is the time reversed" in table["warnings"][2]
    robust = fit_batch([with_outliers(), slipped()], MODEL, MACHINE, loss="cauchy")
    assert robust.converged[0] and robust.std_errors["mu"][0] < 1.2 * robust.white_std_errors["mu"][0]


def test_a_saved_fit_keeps_its_status(tmp_path):
    found = fit(Record(slipped()), MODEL, MACHINE)
    back = load_fit(found.save(tmp_path / "fit.json"))
    assert (back.described, back.optimum_found, back.status) == (False, True, found.status)


def test_comparison_and_multistart_say_the_same():
    told = compare(slipped(), [MODEL, oscillator(RIGS["sliding"], "Coulomb")], [MACHINE, ("mu", "stiffness")])
    assert not told.best.described and not any(row.valid for row in told.rows) and all(row.ended for row in told.rows)
    assert "Coulomb 1 is not valid, does not describe: no cause found" in told.summary()
    best = multistart(slipped(), MODEL, MACHINE, starts=2).best
    assert_named(best, MISFIT)
