"""Uncertainty of the instrument of a rig.

The references are closed forms, fits of changed records, and Monte Carlo.
"""

from typing import Any

import numpy as np
import pytest

from fricjax import Fit, Measured, Oscillator, Rig, Trace, fit, fit_batch, synthetic_run
from fricjax.friction import Coulomb, Tanh
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, RIGS, STIFFNESS, coulomb_run, noisy, oscillator

pytestmark = pytest.mark.slow

SCALE, CLOCK, NONLINEARITY = 1e-4, 2e-4, 0.3e-9
LOAD, FRINGE = 0.005, 316.5e-9
SOURCES = ("displacement_scale", "time_scale", "periodic_nonlinearity_cosine", "periodic_nonlinearity_sine")


def rig(load: float = 9.66, **inputs: Any) -> Rig:
    machine = {"mass": PROTOTYPE_MASS, "stiffness": STIFFNESS, "damping": PROTOTYPE_DAMPING, "normal_force": load}
    return Rig(**{**machine, **inputs})


UNCERTAIN: dict[str, Any] = {
    "displacement_scale": Measured(1.0, SCALE),
    "time_scale": Measured(1.0, CLOCK),
    "periodic_nonlinearity": Measured(0.0, NONLINEARITY),
}
FULL = rig(normal_force=Measured(9.66, LOAD * 9.66), **UNCERTAIN)


@pytest.fixture(scope="module")
def found() -> Fit:
    return fit(coulomb_run(), FULL.oscillator(Coulomb(0.05)), MACHINE, rig=FULL)


# Powers of the displacement and time scales in the parameters, for known mass and load: the dead band is a length,
# k = m omega^2, c = 2 zeta m omega, and mu = k x_d/N.
POWERS = {
    "mu": (1, -2),
    "damping": (0, -1),
    "stiffness": (0, -2),
    "natural_frequency": (0, -1),
    "damping_ratio": (0, 0),
    "dead_band": (1, 0),
    "friction_deceleration": (1, -2),
}


@pytest.mark.parametrize("name", POWERS)
def test_scales_of_displacement_and_time_act_by_their_powers(found: Fit, name: str):
    value = found.values[name] if name in found.values else found.kinematics[name].value
    parts = found.contributions[name]
    told = parts["displacement_scale"] / value / SCALE, parts["time_scale"] / value / CLOCK
    assert told == pytest.approx(POWERS[name], abs=1e-6)


def test_combined_errors_are_the_quadrature_of_all_contributions(found: Fit):
    for name in found.names:
        parts = [found.std_errors[name], *found.contributions[name].values()]
        assert found.combined_std_errors[name] == pytest.approx(np.linalg.norm(parts), rel=1e-9)
    expected = np.linalg.norm([LOAD, SCALE, 2 * CLOCK])
    assert found.combined_std_errors["mu"] / found.values["mu"] == pytest.approx(expected, rel=1e-5)
    band = found.kinematics["dead_band"]
    assert band.std / band.value == pytest.approx(SCALE, rel=1e-3)
    assert tuple(found.contributions["mu"]) == ("normal_force", *SOURCES)


def read_otherwise(trace: Trace, source: str, size: float) -> Trace:
    """Correct a record for an assumed error of the instrument.

    `size` is the error in standard uncertainties.
    """
    t, x = np.asarray(trace.t), np.asarray(trace.x)
    if source == "displacement_scale":
        x = x * (1 + size * SCALE)
    elif source == "time_scale":
        t = t * (1 + size * CLOCK)
    else:
        wave = np.cos if source.endswith("cosine") else np.sin
        x = x - size * NONLINEARITY * wave(2 * np.pi * x / FRINGE)
    return Trace(t, x, sigma=trace.sigma)


def shift(trace: Trace, machine: Oscillator, source: str) -> dict[str, float]:
    """Change of the values by one standard uncertainty, from central differences."""
    low, high = (fit(read_otherwise(trace, source, size), machine, MACHINE) for size in (-1.0, 1.0))
    return {name: (high.values[name] - low.values[name]) / 2 for name in MACHINE}


@pytest.mark.parametrize("source", SOURCES)
def test_a_record_read_otherwise_moves_the_fit_as_told(found: Fit, source: str):
    for name, moved in shift(coulomb_run(), FULL.oscillator(Coulomb(0.05)), source).items():
        told = found.contributions[name][source]
        assert moved == pytest.approx(told, rel=1e-3, abs=0.02 * found.std_errors[name])


def test_so_it_does_under_a_law_without_a_closed_form():
    trace, machine = noisy("rolling", "Tanh", 3), oscillator(RIGS["rolling"], "Tanh")
    uncertain = rig(RIGS["rolling"].load, **UNCERTAIN)
    assert isinstance(machine.friction, Tanh)
    found = fit(trace, machine, MACHINE, rig=uncertain)
    for source in SOURCES:
        for name, moved in shift(trace, machine, source).items():
            told = found.contributions[name][source]
            # The budget is of first order; the relative change of 2e-4 leaves a square.
            assert moved == pytest.approx(told, rel=2e-3, abs=0.02 * found.std_errors[name])


def test_a_coefficient_that_is_known_makes_a_scale_act_otherwise():
    """Fit the mass at a known stiffness.

    Then mu depends on the displacement scale alone, not on the time scale.
    """
    known = rig(displacement_scale=Measured(1.0, SCALE), mass=Measured(PROTOTYPE_MASS, 1e-3 * PROTOTYPE_MASS))
    trace, free = coulomb_run(), ("mu", "damping", "mass")
    found = fit(trace, known.oscillator(Coulomb(0.05)), free, rig=known)
    assert found.combined_std_errors["mu"] / found.values["mu"] == pytest.approx(SCALE, rel=1e-3)


def test_runs_that_are_fitted_together_share_their_instrument():
    traces = [coulomb_run(2e-3, seed=1), coulomb_run(2.4e-3, seed=2)]
    told = fit(traces, FULL.oscillator(Coulomb(0.05)), MACHINE, rig=FULL)
    assert told.contributions["mu"]["displacement_scale"] / told.values["mu"] == pytest.approx(SCALE, rel=1e-5)
    assert told.contributions["stiffness"]["time_scale"] / told.values["stiffness"] == pytest.approx(
        -2 * CLOCK, rel=1e-5
    )


def test_the_report_says_what_is_most_uncertain(found: Fit):
    line = next(line for line in found.summary().splitlines() if line.startswith("rig inputs:"))
    share = LOAD**2 / (LOAD**2 + SCALE**2 + (2 * CLOCK) ** 2)
    assert f"mu: normal_force {100 * share:.0f} % of the variance" in line
    assert "stiffness: time_scale 100 %" in line
    assert "x0" not in line
    assert "rig inputs:" not in fit(coulomb_run(), FULL.oscillator(Coulomb(0.05)), MACHINE).summary()


@pytest.mark.usefixtures("small_chunks")
def test_a_batch_tells_for_each_run_what_a_fit_tells():
    traces = [coulomb_run(x0, seed=i) for i, x0 in enumerate((2e-3, 1.8e-3, 2.4e-3, 2.2e-3))]
    machine = FULL.oscillator(Coulomb(0.05))
    batch = fit_batch([*traces, Trace(traces[0].t, 0 * traces[0].x)], machine, MACHINE, rig=FULL)
    combined = batch.combined_std_errors
    for i, trace in enumerate(traces):
        alone = fit(trace, machine, MACHINE, rig=FULL)
        for name in batch.names:
            assert combined[name][i] == pytest.approx(alone.combined_std_errors[name], rel=1e-3)
            for source, change in alone.contributions[name].items():
                assert batch.contributions[name][source][i] == pytest.approx(
                    change, rel=1e-3, abs=1e-2 * alone.std_errors[name]
                )
        for name, estimate in alone.kinematics.items():
            assert combined[name][i] == pytest.approx(estimate.std, rel=1e-3)
    assert np.isnan(combined["mu"][4])
    assert np.array_equal(batch.to_dataframe()["mu_combined_std"], combined["mu"], equal_nan=True)
    mean = batch.population("mu")
    # The four runs share load, wavelength and clock.
    assert mean.combined_std / mean.mean == pytest.approx(np.linalg.norm([LOAD, SCALE, 2 * CLOCK]), rel=1e-4)
    assert mean.std < 1e-3 * mean.combined_std
    assert "0.05000(25)" in str(mean)


@pytest.mark.parametrize(("workload", "rate"), [("sliding", 5e3), ("rolling", 800.0)])
def test_nonlinearity_of_any_phase_scatters_mu_as_told(workload: str, rate: float):
    """Compare the scatter of forty runs with the combined standard error.

    The offsets give random phases of the nonlinearity. The mean square has a relative standard deviation of a fifth.
    """
    bench, runs, samples, amplitude = RIGS[workload], 40, 3840, 2e-9
    machine, random = oscillator(bench, "Coulomb"), np.random.default_rng(5)
    records = [
        synthetic_run(
            machine, random.uniform(1.6e-3, 2.4e-3), rate=rate, duration=samples / rate, noise=0.5e-9, seed=i,
            periodic_nonlinearity=amplitude, offset=random.uniform(0, 1e-6),
        )
        for i in range(runs)
    ]  # fmt: skip
    known = rig(bench.load, periodic_nonlinearity=Measured(0.0, amplitude / np.sqrt(2)))
    batch = fit_batch(records, machine, MACHINE, rig=known)
    error = batch.values["mu"] - bench.mu
    assert np.mean((error / batch.std_errors["mu"]) ** 2) > 4
    assert 0.5 < np.mean((error / batch.combined_std_errors["mu"]) ** 2) < 1.6
