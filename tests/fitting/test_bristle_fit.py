"""Fits of laws with internal states from the automatic start.

The initial state is a nuisance parameter.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax import Fit, Oscillator, Trace, fit, simulate
from fricjax.errors import UsageError
from fricjax.friction import Coulomb, Dahl, LuGre, MaxwellSlip, RateState
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, RIGS, SIGMA0, SIGMA1, STIFFNESS, coulomb_run, noisy, truth
from tests.oracles import lugre_motion

SEEDS, RIG = 2, RIGS["sliding"]
FREE = (*MACHINE, "sigma0", "sigma1")


def far_off() -> Oscillator:
    """Machine with only the mass and the load right."""
    law = LuGre(3 * RIG.mu, sigma0=20 * SIGMA0, sigma1=SIGMA1 / 30)
    return Oscillator(PROTOTYPE_MASS, 0.8 * STIFFNESS, 4 * PROTOTYPE_DAMPING, RIG.load, law)


@functools.cache
def fits() -> list[Fit]:
    return [fit(noisy("sliding", "LuGre", seed), far_off(), FREE) for seed in range(SEEDS)]


@pytest.mark.slow
def test_lugre_recovers_its_coefficients_from_the_automatic_start():
    for found in fits():
        true = {**truth("sliding", "LuGre", found), "sigma1": SIGMA1}
        pulls = {name: (found.values[name] - true[name]) / found.std_errors[name] for name in found.names}
        assert max(map(abs, pulls.values())) < 4, pulls
        assert found.status == "described" and found.chi2_reduced == pytest.approx(1.0, abs=0.1)
        assert not any(found.flags.values())


def recovers(found: Fit, true: dict[str, float]) -> None:
    pulls = {name: (found.values[name] - value) / found.std_errors[name] for name, value in true.items()}
    assert found.status == "described" and found.chi2_reduced == pytest.approx(1.0, abs=0.1)
    assert max(map(abs, pulls.values())) < 4, pulls


def run_of(machine: Oscillator, x0: float, t: np.ndarray, noise: float, seed: int) -> Trace:
    clean = np.asarray(simulate(machine, x0, t, accuracy=1e-12).x)
    return Trace(t, clean + noise * np.random.default_rng(seed).standard_normal(t.size), sigma=noise)


@pytest.mark.slow
def test_rate_and_state_is_found_although_its_force_jumps_at_each_reversal():
    """Start far from the truth.

    Over fifty half-cycles, the second mesh still leaves a numerical error of 1.8 standard errors.
    """
    law = functools.partial(RateState, a=4e-4, b=2e-4, slip_distance=1e-5)
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 1.89, law(0.01))
    start = Oscillator(PROTOTYPE_MASS, STIFFNESS, 3 * PROTOTYPE_DAMPING, 1.89, law(0.03))
    found = fit(run_of(machine, 2e-3, np.arange(6400) / 3.2e3, 5e-9, 0), start, (*MACHINE, "b"))
    recovers(found, {"mu": 0.01, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS, "b": 2e-4})
    assert found.numerical_shift <= 0.1


@pytest.mark.slow
def test_a_contact_that_rings_on_at_rest_is_found_from_several_runs():
    """Fit a contact that rings at rest.

    The mesh of the first stage does not resolve the ringing.
    """
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Dahl(0.02, sigma0=2e5))
    runs = [run_of(machine, x0, np.arange(1200) / 2e3, 5e-9, i) for i, x0 in enumerate((1.0e-3, 1.4e-3, 1.8e-3))]
    start = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Dahl(0.04, sigma0=1e6))
    found = fit(runs, start, (*MACHINE, "sigma0"))
    recovers(found, {"mu": 0.02, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS, "sigma0": 2e5})


@pytest.mark.slow
@pytest.mark.parametrize("law", [Dahl(0.04, sigma0=1e6), LuGre(0.04, sigma0=1e6)])
def test_a_rigid_contact_is_found_to_be_rigid(law):
    """Fit both laws to a Coulomb run, which is their rigid limit.

    The last stroke of the run is short.
    """
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.02))
    run = run_of(machine, 1.4e-3, np.arange(6000) / 1e4, 1.1e-8, 0)
    start = Oscillator(PROTOTYPE_MASS, STIFFNESS, 2 * PROTOTYPE_DAMPING, 9.66, law)
    found = fit(run, start, (*MACHINE, "sigma0"))
    assert found.status.startswith("at a bound: sigma0.") and found.optimum_found and found.numerical_shift <= 0.1
    assert found.chi2_reduced == pytest.approx(1.0, abs=0.1)
    assert any("is consistent with a rigid contact" in warning for warning in found.warnings)
    for name, value in {"mu": 0.02, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS}.items():
        assert abs(found.values[name] - value) < 4 * found.std_errors[name], name


@pytest.mark.slow
def test_elements_are_found_though_the_instants_at_which_they_slip_move_with_them():
    """Fit the elements of a Maxwell-slip law.

    The steps of a mesh end at the slips of one set of coefficients only.
    """
    truth = {"stiffnesses_0": 4e4, "stiffnesses_1": 2e4, "limits_0": 0.02, "limits_1": 0.03}

    def machine(wrong: float) -> Oscillator:
        values = [wrong * value for value in truth.values()]
        law = MaxwellSlip(values[:2], values[2:])
        return Oscillator(PROTOTYPE_MASS, STIFFNESS, wrong * PROTOTYPE_DAMPING, RIG.load, law)

    t = np.arange(6400) / 20e3
    x = np.asarray(simulate(machine(1.0), 2e-3, t, accuracy=1e-12).x)
    trace = Trace(t, x + 1e-9 * np.random.default_rng(0).standard_normal(t.size), sigma=1e-9)
    found = fit(trace, machine(3.0), (*truth, "damping", "stiffness"))
    assert found.status == "described" and found.chi2_reduced == pytest.approx(1.0, abs=0.1)
    assert found.numerical_shift <= 0.1
    true = {**truth, "damping": PROTOTYPE_DAMPING, "stiffness": STIFFNESS}
    for name, value in true.items():
        assert abs(found.values[name] - value) < 4 * found.std_errors[name], name


@pytest.mark.slow
@pytest.mark.parametrize("z0", [0.0, 1.0])
def test_the_state_at_the_release_is_found(z0):
    """Fit a relaxed and a pulled contact."""
    t = np.arange(1600) / 20e3
    x = released(t, z0)
    trace = Trace(t, x + 1e-9 * np.random.default_rng(7).standard_normal(t.size), sigma=1e-9)
    law = LuGre(RIG.mu, sigma0=SIGMA0, sigma1=SIGMA1)
    start = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, RIG.load, law)
    found = fit(trace, start, ("mu", "sigma0"), start="release", nuisance=("x0", "z0"))
    assert found.values["z0"] == pytest.approx(z0, abs=4 * found.std_errors["z0"])
    assert found.values["sigma0"] == pytest.approx(SIGMA0, abs=4 * found.std_errors["sigma0"])
    assert found.std_errors["z0"] < 0.01


def released(t: np.ndarray, z0: float) -> np.ndarray:
    """Displacement after a release from rest with bent bristles.

    `z0` is the initial deflection of the bristles over the steady one.
    """
    force = RIG.mu * RIG.load
    return lugre_motion(
        t, 2e-3, mass=PROTOTYPE_MASS, stiffness=STIFFNESS, damping=PROTOTYPE_DAMPING, kinetic=force, static=force,
        v_stribeck=1e-3, sigma=(SIGMA0, SIGMA1, 0.0), bent=z0,
    )  # fmt: skip


def test_a_law_without_a_state_has_no_state_at_the_release():
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, RIG.load, Coulomb(RIG.mu))
    with pytest.raises(UsageError, match="z0 is the start of a law's internal state, and this law has none"):
        fit(coulomb_run(), machine, MACHINE, start="release", nuisance=("x0", "z0"))


@pytest.mark.parametrize("exponent", [1.0, 1.5])
def test_second_derivatives_are_finite_at_full_sliding(exponent):
    """Differentiate at the start of a fit of Dahl's law.

    A Rosenbrock solver needs these derivatives for the derivatives of the motion.
    """
    limit = jnp.asarray([-RIG.mu * RIG.load / SIGMA0])

    def slope(sigma0):
        law = Dahl(RIG.mu, sigma0, exponent)
        return jax.jvp(lambda z: law.rate(jnp.asarray(-0.1), z, jnp.asarray(RIG.load)), (limit,), (jnp.ones(1),))[1]

    assert np.all(np.isfinite(jax.jacfwd(slope)(jnp.asarray(SIGMA0))))
