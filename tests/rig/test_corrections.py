"""Corrections of a rig against integrations and quadratures."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from fricjax.errors import UsageError
from fricjax.rig import corrections

K, N, MU, FREQUENCY = 2574.0, 9.66, 0.05, 12.6
OMEGA = 2 * np.pi * FREQUENCY
M = K / OMEGA**2


def test_tilt_moves_the_equilibrium_and_hardly_mu():
    """Check shift and relative change of mu.

    They are 3.8 um and 1e-6 for 1 mrad, and 38 um and 1e-4 for 10 mrad.
    """
    for angle, shift, change in ((1e-3, 3.76e-6, 1.1e-6), (1e-2, 37.6e-6, 1.1e-4)):
        found = corrections.tilt(MU, angle, N, K)
        assert found.shift == pytest.approx(shift, rel=0.01)
        assert 0 <= found.effective / MU - 1 <= change


def test_a_tilted_stroke_swings_about_the_two_forces():
    """Compare turning points under two forces with those of the effective force.

    The latter are about the shifted equilibrium.
    """
    found = corrections.tilt(MU, 5e-3, N, K)
    band, y = found.effective * N / K, 1e-3
    down = y - 2 * (y - found.downhill * N / K)
    up = down - 2 * (down + found.uphill * N / K)
    expected = found.shift * -1 + np.array([y + found.shift, -(y + found.shift) + 2 * band, y + found.shift - 4 * band])
    assert np.array([y, down, up]) == pytest.approx(expected, abs=1e-15)


def test_the_load_on_an_arc_is_the_mean_over_the_stroke():
    length, a = 0.1, 2e-3
    work = quad(
        lambda p: (6 / (5 * length)) * ((OMEGA * a * np.sin(p)) ** 2 - (OMEGA * a * np.cos(p)) ** 2) * np.sin(p),
        0,
        np.pi,
    )[0]
    path = quad(np.sin, 0, np.pi)[0]
    assert corrections.arcuate_load(a, FREQUENCY, length) == pytest.approx(work / path / corrections.GRAVITY, rel=1e-9)
    assert corrections.arcuate_load([0.8e-3, 2e-3], FREQUENCY, 0.1)[0] == pytest.approx(1.7e-3, rel=0.05)


def test_leaves_stiffen_in_tension():
    assert corrections.stiffness_under_load(K, N, 0.1, in_tension=True) - K == pytest.approx(115.92)
    assert corrections.stiffness_under_load(K, N, 0.1, in_tension=False) - K == pytest.approx(-115.92)
    with pytest.raises(UsageError, match="buckle"):
        corrections.stiffness_under_load(10.0, 9.66, 0.1, in_tension=False)


def test_a_weight_floats_a_little():
    assert corrections.weight_in_air(1.0) / corrections.GRAVITY - 1 == pytest.approx(-1.5e-4, rel=0.02)


def test_a_slow_release_makes_a_smaller_and_later_swing():
    tau, x0 = 3e-3, 1e-3
    found = corrections.release(tau, FREQUENCY, x0)
    end = 12 * tau
    moved = solve_ivp(
        lambda t, s: [s[1], -(OMEGA**2) * s[0] + OMEGA**2 * x0 * np.exp(-t / tau)],
        (0, end),
        [x0, 0.0],
        rtol=1e-12,
        atol=1e-15,
    ).y[:, -1]
    assert np.hypot(moved[0], moved[1] / OMEGA) == pytest.approx(found.amplitude_factor * x0, rel=1e-5)
    phase = np.arctan2(-moved[1] / OMEGA, moved[0])
    assert np.cos(phase - OMEGA * (end - found.delay)) == pytest.approx(1.0, abs=1e-9)
    assert found.amplitude_factor - 1 == pytest.approx(-2.7e-2, abs=1e-3)
    assert corrections.release(tau, FREQUENCY, x0, 0.5e-3).onset == pytest.approx(tau * np.log(2))
    with pytest.raises(UsageError, match="nothing moves"):
        corrections.release(tau, FREQUENCY, 1e-4, 2e-4)


def test_a_yielding_holder_gives_back_work():
    """Integrate Dahl's law over one stroke from rest under full deflection."""
    force, sigma0, y = MU * N, 1e6, 1.5e-3
    band, deflection = force / K, force / sigma0

    def rates(_, s):
        return [s[1], (-K * s[0] - sigma0 * s[2]) / M, s[1] - abs(s[1]) * s[2] / deflection]

    def stands(t, s):
        return s[1] if t > 1e-3 else -1.0

    stands.terminal = True
    found = solve_ivp(rates, (0, 0.1), [y, 0.0, deflection], events=stands, method="Radau", rtol=1e-10, atol=1e-14)
    turned = corrections.with_compliance(y, band, sigma0, force)
    assert -found.y[0, -1] == pytest.approx(turned, abs=2e-9)
