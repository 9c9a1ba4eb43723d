"""Global sensitivities against closed forms, and derivative curves against differences."""

import jax.numpy as jnp
import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from tests.sensitivity.machines import prototype

RANGE = (-np.pi, np.pi)


def ishigami(p):
    return jnp.sin(p["x"]) + 7 * jnp.sin(p["y"]) ** 2 + 0.1 * p["z"] ** 4 * jnp.sin(p["x"])


@pytest.fixture(scope="module")
def found():
    return fj.sensitivity.sobol(ishigami, dict.fromkeys("xyz", RANGE), samples=4096)


def test_ishigami(found):
    """Compare with the closed forms of the Ishigami function.

    The forms are its indices and mean squared derivatives (Ishigami and Homma, 1990).
    """
    a, b = 7.0, 0.1
    variance = a**2 / 8 + b * np.pi**4 / 5 + b**2 * np.pi**8 / 18 + 0.5
    alone = np.array([0.5 * (1 + b * np.pi**4 / 5) ** 2, a**2 / 8, 0.0]) / variance
    shared = b**2 * np.pi**8 * (1 / 18 - 1 / 50) / variance
    assert found.variance == pytest.approx(variance, rel=0.01)
    assert found.first == pytest.approx(alone, abs=0.02)
    assert found.total == pytest.approx(alone + np.array([shared, 0.0, shared]), abs=0.02)
    # E[cos^2 x] E[(1 + b z^4)^2], E[(a sin 2y)^2], E[(4 b z^3)^2] E[sin^2 x].
    fourth, eighth, sixth = np.pi**4 / 5, np.pi**8 / 9, np.pi**6 / 7
    squares = [0.5 * (1 + 2 * b * fourth + b**2 * eighth), a**2 / 2, 16 * b**2 * sixth * 0.5]
    assert found.derivatives == pytest.approx(squares, rel=0.03)


def test_the_bound_by_derivatives_holds(found):
    assert np.all(found.total <= found.bounds + found.total_errors)
    assert found.bounds == pytest.approx(found.derivatives * (2 * np.pi) ** 2 / (np.pi**2 * found.variance))
    assert "Bound by derivatives" in found.summary()
    assert found.plot().get_axes()[0].get_xlabel() == "Part of the variance [1]"


@pytest.mark.slow
def test_of_small_ranges_the_indices_are_those_of_the_first_order():
    """Compare with shares of squared slopes times ranges, by `local`.

    In small ranges, a decay is linear in its parameters.
    """
    ts = np.array([0.0, 0.31])
    ranges = {"mu": (0.05, 0.05001), "damping": (0.17, 0.1705)}

    def reading(p):
        machine = fj.Oscillator(0.41, 2574.0, p["damping"], 9.66, fj.friction.Coulomb(p["mu"]))
        return fj.simulate(machine, 5e-3, ts, engine="exact").x[1]

    found = fj.sensitivity.sobol(reading, ranges, samples=256)
    machine = fj.Oscillator(0.41, 2574.0, 0.17025, 9.66, fj.friction.Coulomb(0.050005))
    slopes = fj.sensitivity.local(machine, 5e-3, ts, list(ranges))[1] * [np.ptp(ends) for ends in ranges.values()]
    assert found.total == pytest.approx(slopes**2 / np.sum(slopes**2), abs=0.01)


def test_curves_are_differences_of_readings():
    machine, ts = prototype(fj.friction.Coulomb(0.05)), np.linspace(0.0, 0.1, 50)
    found = fj.sensitivity.curves(machine, 1e-3, ts, ["mu", "x0", "offset"])
    readings = [np.asarray(fj.simulate(prototype(fj.friction.Coulomb(mu)), 1e-3, ts).x) for mu in (0.05005, 0.04995)]
    assert found.relative[:, 0] == pytest.approx((readings[0] - readings[1]) / 2e-3 / 1e-3, abs=1e-6)
    # A change of x0 and a change of the offset by the same amount move the first reading equally.
    assert found.relative[0, 1] == found.relative[0, 2] == pytest.approx(1.0)
    assert found.plot().get_axes()[-1].get_xlabel() == "Time [ms]" and "Sensitivity over the run" in found.summary()


@pytest.mark.parametrize(
    ("ranges", "samples", "sentence"),
    [
        ({"x": (1.0, 0.0)}, 64, "The range of x must be a lower and a larger upper end, got 1.0 and 0.0."),
        ({"x": (0.0, 1.0)}, 100, "a power of two of samples, got 1 and 100"),
        ({}, 64, "at least one range"),
    ],
)
def test_what_is_refused(ranges, samples, sentence):
    with pytest.raises(UsageError, match=sentence):
        fj.sensitivity.sobol(lambda p: p["x"], ranges, samples=samples)
