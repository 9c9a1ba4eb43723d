"""Event-driven integration in time under set-valued friction.

The tests compare driven and free motions with closed forms and theory.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fricjax.friction import Ageing, Coulomb, Stribeck, Tanh
from fricjax.instrument import white_acceleration
from fricjax.oscillator import ExponentialRelease, Oscillator, restoring, simulate
from tests.compilations import compilations
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS

STIFFNESS = 2574.0
OMEGA = 2 * np.pi * 12.6


def rig(friction, normal_force=1.89, damping=PROTOTYPE_DAMPING, **further) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, damping, normal_force, friction, **further)


def free(damping_ratio: float = 0.0) -> Oscillator:
    """Flexure without contact, slowed only by damping."""
    return rig(Coulomb(0.0), 0.0, 2 * damping_ratio * PROTOTYPE_MASS * OMEGA)


@pytest.mark.slow
@pytest.mark.parametrize("duration", [2.0, 4.0])
def test_undriven_rolling_is_exact_to_a_tenth_of_a_nanometre(duration):
    ts = np.arange(int(5e3 * duration)) / 5e3
    ours, exact = (simulate(rig(Coulomb(0.01)), 2e-3, ts, engine=name) for name in ("diffrax", "exact"))
    assert np.abs(ours.x - np.asarray(exact.x)).max() < 1e-10
    # At the instant of a reversal, rounding decides whether the mass already rests.
    assert np.count_nonzero(ours.at_rest != np.asarray(exact.at_rest)) <= 1


@pytest.mark.slow
@pytest.mark.parametrize(
    "oscillator",
    [
        rig(Stribeck(0.05, 0.065, 5e-3), 9.66),
        rig(Coulomb(0.05, 0.065), 9.66),
        rig(Coulomb(0.02), 9.66, drag=20.0, restoring=restoring.Cubic(5e7)),
    ],
    ids=["stribeck", "static", "drag and cubic spring"],
)
@pytest.mark.parametrize("start", [(2e-3, 0.0), (-1e-3, 0.05)])
def test_undriven_motion_agrees_with_half_cycles(oscillator, start):
    ts = np.arange(6000) / 2e4
    ours = simulate(oscillator, start[0], ts, v0=start[1], engine="diffrax")
    half_cycles = simulate(oscillator, start[0], ts, v0=start[1])
    assert half_cycles.engine in ("exact", "hybrid")
    assert np.abs(ours.x - np.asarray(half_cycles.x)).max() < 3e-10


@pytest.mark.parametrize("tau", [1e-5, 1e-3, 3e-3])
def test_release_without_friction_has_a_closed_form(tau):
    ts = np.arange(2000) / 5e3
    x = simulate(free(), 2e-3, ts, release=ExponentialRelease(tau)).x
    lag = OMEGA * tau
    swing = (np.cos(OMEGA * ts) + lag * np.sin(OMEGA * ts) + lag**2 * np.exp(-ts / tau)) / (1 + lag**2)
    np.testing.assert_allclose(x, 2e-3 * swing, rtol=0, atol=1e-10)
    later = ts > 0.1 + 40 * tau
    design = np.stack([np.cos(OMEGA * ts[later]), np.sin(OMEGA * ts[later])], axis=1)
    amplitude = np.hypot(*np.linalg.lstsq(design, x[later], rcond=None)[0])
    assert amplitude == pytest.approx(2e-3 / np.sqrt(1 + lag**2), rel=1e-7)


@pytest.mark.slow
@given(mu_s=st.floats(0.02, 0.2), tau=st.floats(5e-4, 3e-3), sign=st.sampled_from([-1.0, 1.0]))
@settings(max_examples=10)
def test_friction_delays_the_onset_of_slip(mu_s, tau, sign):
    ts = np.arange(4000) / 2e5
    x0, held = 2e-3 * sign, mu_s * 9.66 / STIFFNESS
    motion = simulate(rig(Coulomb(0.02, mu_s), 9.66), x0, ts, release=ExponentialRelease(tau))
    onset = -tau * np.log(1 - held / 2e-3)
    first = np.flatnonzero(~np.asarray(motion.at_rest))[0]
    assert ts[first - 1] <= onset + 1e-12 <= ts[first] + 2e-12
    assert np.all(motion.x[:first] == x0)


@pytest.mark.slow
def test_an_aged_contact_slips_late_and_only_once():
    tau, x0, law = 3e-3, 2e-3, Ageing(0.02, 0.002, 100.0, 0.05)
    ts, aged = np.arange(4000) / 2e4, 0.05 + 0.002 * np.log(101)
    found = simulate(rig(law, 9.66), x0, ts, release=ExponentialRelease(tau))
    slip = -tau * np.log(1 - aged * 9.66 / STIFFNESS / x0)
    assert abs(ts[~np.asarray(found.at_rest)][0] - slip) <= 1 / 2e4
    still = simulate(rig(law, 9.66), 0.99 * aged * 9.66 / STIFFNESS, ts, release=ExponentialRelease(tau))
    assert np.all(still.at_rest)
    start = 0.095 * 9.66 / STIFFNESS  # its first reversal lies between the static and the breakaway force
    young, old = (simulate(rig(each, 9.66), start, ts, engine="diffrax") for each in (Coulomb(0.02, 0.05), law))
    assert 0.05 < -young.x.min() * STIFFNESS / 9.66 < aged
    np.testing.assert_allclose(old.x, young.x, rtol=0, atol=1e-12)


@pytest.mark.parametrize("start", [(2e-3, 0.0), (-1e-3, 0.05)])
def test_before_time_zero_a_free_motion_is_continued_as_by_the_closed_form(start):
    ts = np.array([-2e-4, -1e-4, 0.0, 0.1])
    ours, exact = (
        simulate(rig(Coulomb(0.01)), start[0], ts, v0=start[1], engine=name) for name in ("diffrax", "exact")
    )
    # The jerk is below omega^3 x0. Its effect in 2e-4 s is at most 1.4 nm. A held mass would be off by 200 nm or 10 um.
    assert np.abs(ours.x - np.asarray(exact.x)).max() < 2e-9
    assert np.array_equal(ours.at_rest, exact.at_rest)


@pytest.mark.slow
@pytest.mark.parametrize("law", [Coulomb(0.01), Tanh(0.01, 1e-4)], ids=["set-valued", "smooth"])
def test_driven_motions_of_many_lengths_are_compiled_once(law):
    ts = np.arange(2048) / 5e3
    floor = 0.05 * np.sin(100 * ts)
    full = simulate(rig(law), 1e-3, ts, base_acceleration=floor, release=ExponentialRelease(1e-3))
    with compilations() as compiled:
        short = simulate(rig(law), 1e-3, ts[:1500], base_acceleration=floor[:1500], release=ExponentialRelease(1e-3))
    assert short.x.shape == short.at_rest.shape == (1500,)
    np.testing.assert_allclose(short.x, np.asarray(full.x)[:1500], rtol=0, atol=1e-11)
    assert not [name for name in compiled if "_first" not in name]


@pytest.mark.slow
def test_before_the_release_the_mass_is_held():
    ts = np.arange(300) / 1e3 - 0.1
    motion = simulate(rig(Coulomb(0.01)), 1e-3, ts, base_acceleration=np.full(300, 50.0))
    assert np.all(motion.x[ts <= 0] == 1e-3)
    assert np.all(motion.at_rest[ts < 0])
    assert np.ptp(np.asarray(motion.x)[ts > 0]) > 1e-4


@pytest.mark.slow
@given(push=st.floats(0.2, 3.0))
@settings(max_examples=15)
def test_a_steady_floor_is_a_shifted_equilibrium(push):
    """Compare a constantly accelerated floor with an equilibrium shifted by m a/k."""
    ts = np.arange(3000) / 5e3
    shift = PROTOTYPE_MASS * push / STIFFNESS
    ours = simulate(rig(Coulomb(0.02), 9.66), 1e-3, ts, base_acceleration=np.full(ts.shape, push))
    exact = simulate(rig(Coulomb(0.02), 9.66), 1e-3 + shift, ts, engine="exact")
    assert np.abs(ours.x + shift - np.asarray(exact.x)).max() < 1e-10


@pytest.mark.slow
def test_a_resting_mass_slips_when_the_floor_pulls_hard_enough():
    ts = np.arange(1000) / 1e3
    slope, band = 2.0, 0.05 * 9.66 / PROTOTYPE_MASS
    motion = simulate(rig(Coulomb(0.03, 0.05), 9.66), 0.0, ts, base_acceleration=slope * ts)
    first = np.flatnonzero(~np.asarray(motion.at_rest))[0]
    assert ts[first - 1] <= band / slope <= ts[first]
    assert motion.v[first] < 0


@pytest.mark.slow
def test_sinusoidal_floor_gives_the_response_of_the_flexure():
    """Compare with the steady response without contact.

    For a floor acceleration a sin(W t) it is -a/(omega^2 - W^2 + 2i zeta omega W).
    """
    ts, drive = np.arange(40_000) / 1e4, 2 * np.pi * 20.0
    x = simulate(free(0.1), 0.0, ts, base_acceleration=0.5 * np.sin(drive * ts)).x
    answer = -0.5 / (OMEGA**2 - drive**2 + 2j * 0.1 * OMEGA * drive)
    steady = ts > 2.0
    expected = np.imag(answer * np.exp(1j * drive * ts[steady]))
    # The straight lines between samples lower the drive by sinc^2(20 Hz/10 kHz).
    assert np.abs(x[steady] - np.sinc(20 / 1e4) ** 2 * expected).max() < 1e-4 * abs(answer)


@pytest.mark.slow
def test_floor_motion_makes_the_flexure_swing_as_miles_says():
    rate, density, ratio, samples = 1e3, 3.4e-7, 0.05, 400_000
    floor = white_acceleration(samples, rate, density, np.random.default_rng(5))
    x = simulate(free(ratio), 0.0, np.arange(samples) / rate, base_acceleration=floor, accuracy=1e-8).x
    miles = density / (8 * ratio * OMEGA**3)
    # 400 s contain about 1600 independent values of x^2, so the standard deviation is 2.5 %.
    assert np.var(x[2000:]) == pytest.approx(miles, rel=0.1)


@pytest.mark.slow
def test_floor_motion_kicks_each_half_cycle():
    """Compare the scatter of turning points with sqrt(S H)/(2 omega) per half-cycle.

    The kicks of different half-cycles are independent.
    """
    density, rate, runs, half = 3.4e-7, 5e3, 12, np.pi / OMEGA
    oscillator, band = rig(Coulomb(0.001), damping=0.0), 0.001 * 1.89 / STIFFNESS
    kicks = []
    for seed in range(runs):
        ts = np.arange(int(2.0 * rate)) / rate
        floor = white_acceleration(ts.size, rate, density, np.random.default_rng(seed))
        amplitudes = turning_amplitudes(simulate(oscillator, 2e-3, ts, base_acceleration=floor))
        kicks += list(np.diff(amplitudes) + 2 * band)
    expected = np.sqrt(density * half) / (2 * OMEGA)
    assert len(kicks) > 550
    assert abs(np.mean(kicks)) < 5 * expected / np.sqrt(len(kicks))
    # 4.5 standard deviations of the standard deviation of some 580 kicks.
    assert np.std(kicks) == pytest.approx(expected, rel=0.13)


def turning_amplitudes(motion) -> np.ndarray:
    """Return |x| at the reversals.

    A parabola from the sample before each reversal gives it to a fraction of a nanometre.
    """
    t, x, v = (np.asarray(part) for part in (motion.t, motion.x, motion.v))
    i = np.flatnonzero(v[:-1] * v[1:] < 0)
    a = (v[i] - v[i - 1]) / (t[i] - t[i - 1])
    return np.abs(x[i] - v[i] ** 2 / (2 * a))
