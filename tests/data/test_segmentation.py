"""The anatomy of a decay against closed forms, integrated creep, and measured runs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from fricjax.data import DataError, read, segment, segment_record
from tests.oracles import coulomb_viscous

FREQUENCY = 12.6


def decay(strokes, *, rate=10e3, noise=0.0, zeta=0.0027, hold=0.0, tail=3.0, offset=0.0, step=0.0, static=1.0, seed=0):
    """A closed-form decay of roughly so many half-cycles, with noise and rounding; `tail` half-periods of rest."""
    band = 2e-3 / (2 * strokes + 0.3)
    duration = hold + (strokes + tail) / (2 * FREQUENCY)
    t = np.arange(0, duration, 1 / rate)
    exact = coulomb_viscous(
        t, 2e-3 + offset, frequency=FREQUENCY, zeta=zeta, dead_band=band, static_band=static * band, offset=offset,
        release=hold,
    )  # fmt: skip
    x = exact.x + noise * np.random.default_rng(seed).standard_normal(t.size)
    return exact, np.round(x / step) * step if step else x


@pytest.mark.parametrize("noise", [0.0, 1e-9, 5e-9])
@pytest.mark.parametrize("strokes", [1, 2, 3, 8, 30, 120])
@pytest.mark.parametrize("hold", [0.0, 0.25])
def test_a_decay_to_rest(strokes, noise, hold):
    exact, x = decay(strokes, noise=noise, hold=hold)
    found = segment(exact.t, x)
    assert found.n_half_cycles == exact.n_half_cycles
    assert found.turning_times.size == exact.n_half_cycles - 1
    assert found.turning_times == pytest.approx(exact.stops[:-1], abs=1e-2 * exact.half_period)
    assert found.turning_points == pytest.approx(exact.points[:-1], abs=3 * noise + 1e-10)
    assert found.rest == pytest.approx(exact.stops[-1], abs=1e-2 * exact.half_period)
    assert found.rest_position == pytest.approx(exact.points[-1], abs=noise + 1e-10)
    assert found.release == pytest.approx(hold, abs=1e-2 * exact.half_period)
    assert found.half_period == pytest.approx(exact.half_period, rel=2e-2)
    assert found.amplitude == pytest.approx((2e-3 - exact.points.min()) / 2, rel=1e-4)
    if noise:
        assert found.noise == pytest.approx(noise, rel=0.2)


@pytest.mark.parametrize("strokes", [3, 20, 300])
def test_a_record_that_ends_in_motion(strokes):
    exact, x = decay(strokes, noise=2e-9, zeta=0.0, tail=-0.45 * strokes)
    found = segment(exact.t, x)
    expected = np.count_nonzero(exact.stops < exact.t[-1])
    assert found.rest is None and found.rest_position is None
    assert found.n_half_cycles == expected == found.turning_times.size
    assert found.n_half_cycles_after_first_reversal == expected - 1
    assert found.cycles == expected / 2


@given(
    strokes=st.integers(1, 40), noise=st.sampled_from([0.0, 1e-9, 5e-9]), zeta=st.sampled_from([0.0, 0.003, 0.03]),
    rate=st.sampled_from([5e3, 12e3]), hold=st.sampled_from([0.0, 0.1]), offset=st.floats(-5e-3, 5e-3),
    static=st.floats(1.0, 1.3), step=st.sampled_from([0.0, 0.309e-9]), seed=st.integers(0, 99),
)  # fmt: skip
def test_counts_hold_whatever_the_record(strokes, noise, zeta, rate, hold, offset, static, step, seed):
    exact, x = decay(
        strokes, noise=noise, zeta=zeta, rate=rate, hold=hold, offset=offset, static=static, step=step, seed=seed
    )
    last = np.abs(np.diff([2e-3 + offset, *exact.points]))[-1]
    found = segment(exact.t, x)
    if last > 20 * max(noise, step):
        assert found.n_half_cycles == exact.n_half_cycles
        assert found.rest == pytest.approx(exact.stops[-1], abs=0.1 * exact.half_period)
        assert found.rest_position == pytest.approx(exact.points[-1], abs=noise + step + 1e-9)
    assert found.release == pytest.approx(hold, abs=1e-2 * exact.half_period)


def test_quantised_data_tell_their_step():
    exact, x = decay(12, step=1e-6)
    found = segment(exact.t, x)
    assert found.resolution == pytest.approx(1e-6, rel=1e-6)
    assert found.noise >= 0.999e-6 / np.sqrt(12)
    assert found.n_half_cycles == exact.n_half_cycles
    assert found.turning_points == pytest.approx(exact.points[:-1], abs=1e-6)


@pytest.mark.parametrize("slope", [20e-9, -20e-9, 20e-6, -20e-6])
def test_drift_is_no_motion(slope):
    exact, x = decay(10, noise=1e-9, tail=60)
    found = segment(exact.t, x + slope * exact.t)
    assert found.n_half_cycles == exact.n_half_cycles
    assert found.rest == pytest.approx(exact.stops[-1], abs=0.04 * exact.half_period)


def creeping(force, v_s, duration):
    """A regularised friction law, integrated with SciPy: it creeps where the real mass rests."""
    mass, stiffness, damping = 0.41, 2574.0, 0.17
    t = np.arange(0, duration, 1e-4)

    def rate(_, state):
        x, v = state
        return [v, -(stiffness * x + damping * v + force * np.tanh(v / v_s)) / mass]

    x = solve_ivp(rate, (0, duration), [2e-3, 0.0], "Radau", t, rtol=1e-8, atol=1e-12).y[0]
    omega, zeta = np.sqrt(stiffness / mass), damping / 2 / np.sqrt(stiffness * mass)
    return x, coulomb_viscous(t, 2e-3, frequency=omega / 2 / np.pi, zeta=zeta, dead_band=force / stiffness)


@pytest.mark.parametrize(("force", "v_s"), [(0.5, 1e-6), (0.5, 1e-4), (0.1, 1e-5), (0.1, 1e-4)])
@pytest.mark.parametrize("duration", [1.0, 3.0])
def test_a_creeping_mass_is_at_rest(force, v_s, duration):
    x, exact = creeping(force, v_s, duration)
    found = segment(exact.t, x + 1e-9 * np.random.default_rng(1).standard_normal(x.size))
    assert found.n_half_cycles == exact.n_half_cycles
    assert found.rest == pytest.approx(exact.stops[-1], abs=0.02 * exact.half_period)


def test_a_viscous_decay_ends_in_its_noise():
    t = np.arange(0, 6, 1e-4)
    x = 2e-3 * np.exp(-3 * t) * np.cos(80 * t) + 1e-9 * np.random.default_rng(0).standard_normal(t.size)
    found = segment(t, x)
    fallen = np.log(2e-3 / 6e-9) / 3
    assert found.rest == pytest.approx(fallen, abs=0.4)
    assert found.half_period == pytest.approx(np.pi / 80, rel=1e-3)


def test_masked_samples_are_not_looked_at():
    exact, x = decay(8, noise=1e-9)
    mask = np.ones(x.size, dtype=bool)
    mask[500:560] = False
    found = segment(exact.t, np.where(mask, x, 1.0), mask=mask)
    assert found.n_half_cycles == exact.n_half_cycles


def test_uneven_sampling():
    exact, x = decay(8, rate=20e3, noise=1e-9)
    keep = np.random.default_rng(3).random(x.size) < 0.5
    found = segment(exact.t[keep], x[keep])
    assert found.noise == pytest.approx(1e-9, rel=0.2)
    assert found.turning_points == pytest.approx(exact.points[:-1], abs=4e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-9])
def test_a_constant_trace_is_refused(noise):
    t = np.arange(0, 1, 1e-3)
    x = 0.3 + noise * np.random.default_rng(0).standard_normal(t.size)
    with pytest.raises(DataError, match="x is constant"):
        segment(t, x)


def test_sparse_sampling_is_refused():
    exact, x = decay(10, rate=100)
    with pytest.raises(DataError, match=r"only about 4\.\d samples per half-cycle, at least 8"):
        segment(exact.t, x)


def test_too_few_used_samples_are_refused():
    with pytest.raises(DataError, match="at least 3 used samples, but it has 2"):
        segment([0.0, 1.0, 2.0], [0.0, 1.0, 0.0], mask=[True, True, False])


@pytest.mark.parametrize(
    ("name", "release", "first", "position"),
    [("01", 0.25, 0.725, 98.5), ("02", 0.16, 0.614, 125.7), ("03", 0.15, 0.4385, 58.3)],
)
def test_a_pendulum_held_by_hand(measured_data, name, release, first, position):
    path = measured_data(f"rotary-pendulum/data{name}.txt")
    found = segment_record(read(path, rate=1000, unit="deg"))
    assert found.release == pytest.approx(release, abs=0.04)
    assert found.first_reversal == pytest.approx(first, abs=0.005)
    assert found.turning_points[0] == pytest.approx(np.deg2rad(position), abs=0.01)
    assert found.rest is None
    assert np.all(np.diff(np.abs(found.turning_points)[::2]) < 0)
    assert found.resolution == pytest.approx(np.deg2rad(0.0909), rel=0.02)


def test_a_small_swing_to_rest(measured_data):
    path = measured_data("multiarm-pendulum/SingleDataFreeSwing_1_Dt_0_0001.mat")
    found = segment_record(read(path, column="Theta1", unit="rad"))
    assert found.resolution == pytest.approx(2 * np.pi / 40000, rel=1e-6)
    assert found.n_half_cycles == 15
    assert found.rest == pytest.approx(65.6, abs=0.2)
    assert found.rest_position == pytest.approx(3.1411, abs=3e-4)
    assert found.turning_points[0] == pytest.approx(3.2077, abs=2e-4)


def test_a_large_swing_that_goes_on(measured_data):
    path = measured_data("multiarm-pendulum/SinglePendulumDataForParameterEstimation.mat")
    record = read(path, column="Y_id+Y_vad", time="Time_id+Time_vad", unit="rad")
    found = segment_record(record)
    assert (record.trace.n, found.rest, found.release) == (55001, None, 0.0)
    assert found.turning_times.size == found.n_half_cycles == 133
    assert found.first_reversal == pytest.approx(0.4406, abs=1e-3)
