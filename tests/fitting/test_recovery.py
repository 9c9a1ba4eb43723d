"""Recovery of known coefficients from synthetic runs of each law and rig.

The runs come from an oracle. ``python experiments/recovery/run.py`` fits twenty runs of each.
"""

import functools

import numpy as np
import pytest
from scipy.stats import chi2

from fricjax import Fit, Oscillator, fit
from fricjax.friction import Coulomb
from tests.machines import LAWS, MACHINE, RIGS, noisy, oscillator, truth
from tests.tiers import cases

SEEDS = {"Coulomb": 20, "Tanh": 20, "LuGre": 5}


@functools.cache
def fits(rig: str, law: str) -> list[Fit]:
    """Fit the runs of a workload from the default start."""
    free = (*MACHINE, "sigma0") if law == "LuGre" else MACHINE
    return [fit(noisy(rig, law, seed), oscillator(RIGS[rig], law), free) for seed in range(SEEDS[law])]


def pulls(rig: str, law: str) -> np.ndarray:
    """Errors of all free parameters in standard errors, with shape (seeds, parameters).

    The parameters include those of the run.
    """
    rows = []
    for found in fits(rig, law):
        true = truth(rig, law, found)
        rows.append([(found.values[name] - true[name]) / found.std_errors[name] for name in found.names])
    return np.array(rows)


WORKLOADS = [(rig, law) for rig in RIGS for law in LAWS]
CORE = [("rolling", "Coulomb"), *(("sliding", law) for law in LAWS)]


@pytest.fixture(params=cases(WORKLOADS, CORE), ids=["-".join(each) for each in WORKLOADS], scope="module")
def workload(request):
    return request.param


def test_every_parameter_lies_within_four_standard_errors(workload):
    found, distance = fits(*workload)[0], pulls(*workload)
    worst = dict(zip(found.names, np.abs(distance).max(axis=0).round(2).tolist(), strict=True))
    print(f"\n{'-'.join(workload)}: worst error in standard errors {worst}")
    assert np.all(np.abs(distance) < 4), worst


def test_the_fit_is_valid_and_describes_the_noise(workload):
    ratios = [found.chi2_reduced for found in fits(*workload)]
    print(f"\n{'-'.join(workload)}: reduced chi^2 {min(ratios):.3f} to {max(ratios):.3f}")
    assert min(ratios) > 0.9 and max(ratios) < 1.1
    for found in fits(*workload):
        assert found.converged and found.status == "described"
        assert found.whiteness.white and not found.warnings, found.warnings
        assert not any(found.flags.values())


def test_numerical_errors_move_no_parameter_by_a_tenth_of_its_standard_error(workload):
    shifts = [found.numerical_shift for found in fits(*workload)]
    print(f"\n{'-'.join(workload)}: moved by numerical errors by up to {max(shifts):.1e} standard errors")
    assert max(shifts) <= 0.1


@pytest.mark.slow
def test_standard_errors_are_calibrated(workload):
    """Whiten the scatter of the estimates and test it against chi^2."""
    (rig, law), total = workload, 0.0
    for found in fits(rig, law):
        true = truth(rig, law, found)
        error = np.array([found.values[name] - true[name] for name in found.names])
        total += error @ np.linalg.solve(found.covariance, error)
    dof = SEEDS[law] * len(fits(*workload)[0].names)
    low, high = chi2.ppf([1e-4, 1 - 1e-4], dof)
    print(f"\n{'-'.join(workload)}: whitened errors {total:.1f} for {dof} degrees of freedom")
    assert low < total < high


@pytest.mark.parametrize("law", cases(LAWS, ["Coulomb"]))
def test_rolling_friction_is_found_to_ten_parts_in_a_million(law):
    errors = [found.values["mu"] / RIGS["rolling"].mu - 1 for found in fits("rolling", law)]
    print(f"\nrolling-{law}: relative error of mu up to {np.max(np.abs(errors)):.2e}")
    assert np.max(np.abs(errors)) <= 1e-5


@pytest.mark.parametrize("law", LAWS)
def test_the_bound_of_cramer_and_rao_is_reached_for_sliding_friction(law):
    """Compare relative errors of mu with the Fisher matrix of the rig.

    With free damping and offset it gives some 2e-7 at 10 kHz. These runs have 20 kHz.
    """
    relative = [found.std_errors["mu"] / found.values["mu"] for found in fits("sliding", law)]
    assert min(relative) > 5e-8 and max(relative) < 5e-7


def test_it_fits_from_wrong_start_values_all_the_same():
    """Replace wrong start values of the machine by guesses from the decay."""
    reference = fits("sliding", "Coulomb")[0]
    machine = oscillator(RIGS["sliding"], "Coulomb")
    start = Oscillator(machine.mass, 0.5 * machine.stiffness, 3 * machine.damping, 9.66, Coulomb(0.3))
    found = fit(noisy("sliding", "Coulomb", 0), start, MACHINE)
    assert found.values["mu"] == pytest.approx(reference.values["mu"], abs=1e-2 * reference.std_errors["mu"])
    assert found.chi2 == pytest.approx(reference.chi2, abs=1e-3)
