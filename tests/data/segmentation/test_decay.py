"""Segmentation of decays: closed forms, integrated creep, and measured runs."""

import itertools
import tracemalloc

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.signal import lfilter

from fricjax.data import read, segment, segment_record
from fricjax.data.segmentation.reversals import refine
from fricjax.data.segmentation.swing import extremes, smooth, zigzag
from fricjax.errors import DataError
from tests.oracles import coulomb_viscous
from tests.tables import check_rows

FREQUENCY = 12.6


def decay(
    half_cycles, *, rate=10e3, noise=0.0, zeta=0.0027, hold=0.0, tail=3.0, offset=0.0, step=0.0, static=1.0, seed=0
):
    """Return a closed-form decay, and its displacements with noise and rounding.

    The number of half-cycles is approximate. A rest of `tail` half-periods follows.
    """
    band = 2e-3 / (2 * half_cycles + 0.3)
    duration = hold + (half_cycles + tail) / (2 * FREQUENCY)
    t = np.arange(0, duration, 1 / rate)
    exact = coulomb_viscous(
        t, 2e-3 + offset, frequency=FREQUENCY, zeta=zeta, dead_band=band, static_band=static * band, offset=offset,
        release=hold,
    )  # fmt: skip
    x = exact.x + noise * np.random.default_rng(seed).standard_normal(t.size)
    return exact, np.round(x / step) * step if step else x


def check_decay(half_cycles, noise, hold):
    exact, x = decay(half_cycles, noise=noise, hold=hold)
    found = segment(exact.t, x)
    assert found.n_half_cycles == exact.n_half_cycles
    assert found.turning_times.size == exact.n_half_cycles - 1
    assert found.turning_times == pytest.approx(exact.stops[:-1], abs=1e-2 * exact.half_period)
    assert found.turning_points == pytest.approx(exact.points[:-1], abs=3 * noise + 1e-10)
    assert found.rest == pytest.approx(exact.stops[-1], abs=1e-2 * exact.half_period)
    assert found.rest_position == pytest.approx(exact.points[-1], abs=noise + 1e-10)
    assert found.release == pytest.approx(hold, abs=1e-2 * exact.half_period)
    assert found.release_position == (pytest.approx(2e-3, rel=1e-3) if half_cycles > 1 else None)
    assert found.half_period == pytest.approx(exact.half_period, rel=2e-2)
    assert found.amplitude == pytest.approx((2e-3 - exact.points.min()) / 2, rel=1e-4)
    if noise:
        assert found.noise == pytest.approx(noise, rel=0.2)


def test_a_decay_to_rest():
    check_rows(check_decay, itertools.product([1, 2, 3, 8, 30, 120], [0.0, 1e-9, 5e-9], [0.0, 0.25]))


@pytest.mark.parametrize("memory", [0.8, 0.95])
def test_the_noise_of_a_hold_is_no_motion_however_coloured(memory):
    """Without a rest, only white noise is known at first."""
    for seed in range(20):
        random = np.random.default_rng(seed)
        exact, x = decay(40, rate=2e3, hold=random.uniform(0.02, 0.2), tail=-25.0)
        noise = lfilter([5e-9 * np.sqrt(1 - memory**2)], [1.0, -memory], random.standard_normal(x.size))
        found = segment(exact.t, x + noise)
        assert found.first_reversal == pytest.approx(exact.stops[0], abs=0.02 * exact.half_period)
        # The release position comes from a smoothed record, in which the end of the hold is rounded.
        assert found.release_position is None or found.release_position == pytest.approx(2e-3, rel=1e-3)


def test_a_record_that_ends_in_motion():
    def check(half_cycles):
        exact, x = decay(half_cycles, noise=2e-9, zeta=0.0, tail=-0.45 * half_cycles)
        found = segment(exact.t, x)
        expected = np.count_nonzero(exact.stops < exact.t[-1])
        assert found.rest is None and found.rest_position is None
        assert found.n_half_cycles == expected == found.turning_times.size
        assert found.n_half_cycles_after_first_reversal == expected - 1
        assert found.cycles == expected / 2

    check_rows(check, [3, 20, 300])


def test_a_start_in_mid_half_cycle_is_no_release_from_rest():
    exact, x = decay(4, noise=1e-9)
    for missed in (0.2, 0.5, 0.8):
        kept = exact.t > missed * exact.half_period
        assert segment(exact.t[kept], x[kept]).release_position is None


@given(
    half_cycles=st.integers(1, 40), noise=st.sampled_from([0.0, 1e-9, 5e-9]), zeta=st.sampled_from([0.0, 0.003, 0.03]),
    rate=st.sampled_from([5e3, 12e3]), hold=st.sampled_from([0.0, 0.1]), offset=st.floats(-5e-3, 5e-3),
    static=st.floats(1.0, 1.3), step=st.sampled_from([0.0, 0.309e-9]), seed=st.integers(0, 99),
)  # fmt: skip
def test_counts_hold_whatever_the_record(half_cycles, noise, zeta, rate, hold, offset, static, step, seed):
    exact, x = decay(
        half_cycles, noise=noise, zeta=zeta, rate=rate, hold=hold, offset=offset, static=static, step=step, seed=seed
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


def test_drift_is_no_motion():
    exact, x = decay(10, noise=1e-9, tail=60)

    def check(slope):
        found = segment(exact.t, x + slope * exact.t)
        assert found.n_half_cycles == exact.n_half_cycles
        assert found.rest == pytest.approx(exact.stops[-1], abs=0.04 * exact.half_period)

    check_rows(check, [20e-9, -20e-9, 20e-6, -20e-6])


def creeping(force, v_s):
    """Integrate a regularised law with SciPy; this mass creeps instead of resting."""
    mass, stiffness, damping, duration = 0.41, 2574.0, 0.17, 3.0
    t = np.arange(0, duration, 1e-4)

    def rate(_, state):
        x, v = state
        return [v, -(stiffness * x + damping * v + force * np.tanh(v / v_s)) / mass]

    x = solve_ivp(rate, (0, duration), [2e-3, 0.0], "Radau", t, rtol=1e-8, atol=1e-12).y[0]
    omega, zeta = np.sqrt(stiffness / mass), damping / 2 / np.sqrt(stiffness * mass)
    return x, coulomb_viscous(t, 2e-3, frequency=omega / 2 / np.pi, zeta=zeta, dead_band=force / stiffness)


@pytest.mark.parametrize(
    ("force", "v_s"),
    [(0.5, 1e-6), (0.5, 1e-4), *(pytest.param(0.1, v_s, marks=pytest.mark.slow) for v_s in (1e-5, 1e-4))],
)
def test_a_creeping_mass_is_at_rest(force, v_s):
    x, exact = creeping(force, v_s)
    x = x + 1e-9 * np.random.default_rng(1).standard_normal(x.size)
    for duration in (1.0, 3.0):
        watched = exact.t < duration
        found = segment(exact.t[watched], x[watched])
        assert found.n_half_cycles == exact.n_half_cycles
        assert found.rest == pytest.approx(exact.stops[-1], abs=0.02 * exact.half_period)


def test_a_viscous_decay_ends_in_its_noise():
    t = np.arange(0, 6, 1e-4)
    x = 2e-3 * np.exp(-3 * t) * np.cos(80 * t) + 1e-9 * np.random.default_rng(0).standard_normal(t.size)
    found = segment(t, x)
    # Standard error of the size of a half-cycle: the noise times sqrt(8 / samples), 0.14 nm.
    smallest = 1e-9 * np.sqrt(8 / (np.pi / 80 / 1e-4))
    assert np.log(2e-3 / 6e-9) / 3 < found.rest < np.log(2e-3 / smallest) / 3
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


def test_a_constant_trace_is_refused():
    t = np.arange(0, 1, 1e-3)
    for noise in (0.0, 1e-9):
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


def swinging(samples, *, noise=5e-9, seed=0, duration=2.0):
    """Return fifty half-cycles from 2 mm to 0.6 mm, without a rest."""
    t = np.arange(samples) * (duration / samples)
    exact = coulomb_viscous(t, 2e-3, frequency=FREQUENCY, zeta=0.0, dead_band=1.4e-5)
    return exact, exact.x + noise * np.random.default_rng(seed).standard_normal(samples)


# Bounds at 5 nm of noise and 198 samples per half-cycle: 0.6 us and 1.8 nm for each reversal, then 1/sqrt(n).
@pytest.mark.parametrize(("samples", "runs"), [(10_000, 8), (100_000, 4), (1_000_000, 1)])
def test_reversals_are_as_exact_as_the_noise_allows(samples, runs):
    times, points = [], []
    for seed in range(runs):
        exact, x = swinging(samples, seed=seed)
        found = segment(exact.t, x)
        assert found.n_half_cycles == found.turning_times.size == 50
        times.append(found.turning_times - exact.stops[:50])
        points.append(found.turning_points - exact.points[:50])
    gain = np.sqrt(samples / 10_000)
    assert np.sqrt(np.mean(np.square(times))) < 6.6e-7 / gain
    assert np.sqrt(np.mean(np.square(points))) < 2.2e-9 / gain
    assert abs(np.mean(points)) < 4 * 2.2e-9 / gain / np.sqrt(50 * runs)


def test_a_long_record_is_read_as_one_of_fewer_samples():
    exact, x = decay(20, rate=1e6, noise=5e-9, hold=0.1)
    every, some = segment(exact.t, x), segment(exact.t[::100], x[::100])
    assert every.n_half_cycles == some.n_half_cycles == exact.n_half_cycles
    assert every.turning_times == pytest.approx(some.turning_times, abs=3e-3 * exact.half_period)
    assert every.turning_points == pytest.approx(some.turning_points, abs=15e-9)
    assert every.turning_points == pytest.approx(exact.points[:-1], abs=2e-9)
    assert every.rest == pytest.approx(exact.stops[-1], abs=1e-3 * exact.half_period)
    assert every.release == pytest.approx(some.release, abs=1e-3 * exact.half_period)


def test_memory_grows_with_the_samples_only():
    peaks = []
    for samples in (250_000, 1_000_000):
        exact, x = swinging(samples)
        tracemalloc.start()
        segment(exact.t, x)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert (peaks[1] - peaks[0]) / 750_000 < 50  # bytes a sample


def plain_zigzag(x, threshold):
    """Find pivots by the definition of hysteresis, sample after sample."""
    pivots, high, low, direction = [], 0, 0, 0
    for i in range(x.size):
        high, low = (i if x[i] > x[high] else high), (i if x[i] < x[low] else low)
        if direction >= 0 and x[high] - x[i] > threshold:
            pivots, direction, high, low = [*pivots, high], -1, i, i
        elif direction <= 0 and x[i] - x[low] > threshold:
            pivots, direction, high, low = [*pivots, low], 1, i, i
    return [*pivots, high if direction > 0 else low] if pivots else []


@given(
    seed=st.integers(0, 10**6), size=st.integers(3, 3000), kind=st.sampled_from(["noise", "walk", "decay"]),
    share=st.sampled_from([0.001, 0.03, 0.1, 0.3, 0.6]),
)  # fmt: skip
def test_thinned_extremes_swing_like_all_samples(seed, size, kind, share):
    rng = np.random.default_rng(seed)
    noise, phase = rng.standard_normal(size), rng.uniform(0.001, 0.3) * np.arange(size)
    x = {"noise": noise, "walk": np.cumsum(noise), "decay": np.exp(-phase / 20) * np.sin(phase) + 0.01 * noise}[kind]
    threshold = share * float(np.ptp(x))
    exact = plain_zigzag(x, threshold)
    found = zigzag(x, extremes(x, threshold), threshold)
    finer = zigzag(x, extremes(x, 0.2 * threshold), threshold)
    assert found == finer == exact


def test_few_extremes_of_noise_are_left():
    x = np.random.default_rng(0).standard_normal(300_000)
    assert extremes(x, 12.0).size < 300
    assert extremes(x, 0.0).size > 100_000


def test_smoothing_is_a_moving_average_without_outliers():
    x = 1e3 + np.cumsum(np.random.default_rng(0).standard_normal(300))
    clean = x.copy()
    clean[1:-1] = np.median([x[:-2], x[1:-1], x[2:]], axis=0)
    for width in (3, 7, 101):
        reach = [min(width // 2, i, 299 - i) for i in range(300)]
        exact = [clean[i - r : i + r + 1].mean() for i, r in enumerate(reach)]
        assert smooth(np.arange(300) / 7, x, width, 1 / 7) == pytest.approx(exact, abs=1e-10)


def test_smoothing_keeps_a_straight_line_with_gaps():
    random = np.random.default_rng(0)
    t = np.flatnonzero(random.random(2000) < 0.7) / 1000
    t = t[(t < 0.8) | (t > 0.93)]
    for width in (3, 31, 101):
        assert smooth(t, 2 * t - 1, width, 1e-3) == pytest.approx(2 * t - 1, abs=1e-12)


def turns(samples=20_000):
    exact, x = swinging(samples)
    k = np.arange(49)
    width = np.linspace(0.08, 0.3, 49) * exact.half_period
    guess = exact.stops[:49] + 0.1 * np.sin(k) * width
    return exact, x, guess, np.where(k % 3, 4, 2), width


def test_turns_refined_together_are_those_refined_alone():
    exact, x, guess, order, width = turns()
    omega = np.full(49, np.pi / exact.half_period)
    guess[5] += 0.5  # far from any turn
    together = refine(exact.t, x, guess, omega, [(2 * width, order), (width, order)])
    alone = [
        refine(exact.t, x, guess[k], omega[k], [(2 * width[k], order[k]), (width[k], order[k])]) for k in range(49)
    ]
    assert together[0] == pytest.approx(np.ravel([time for time, _ in alone]), rel=0, abs=1e-10)
    assert together[1] == pytest.approx(np.ravel([point for _, point in alone]), rel=0, abs=1e-13)


def piecewise(parameters, phase, order):
    """Evaluate curves with zero slope at the turn, one on either side."""
    shift, position, *coefficients = parameters
    tau = phase - shift
    terms = np.array([1 - np.cos(tau), tau**3, tau**4][: order - 1])
    before, after = np.reshape(coefficients, (2, -1))
    return position + np.where(tau < 0, before @ terms, after @ terms)


@pytest.mark.parametrize("order", [2, 4])
@pytest.mark.parametrize("samples", [10_000, 200_000])
def test_a_refined_turn_is_the_least_squares_fit(order, samples):
    exact, x, guess, _, width = turns(samples)
    k, omega = 20, np.pi / exact.half_period
    near = np.abs(exact.t - guess[k]) < width[k]
    phase, values = omega * (exact.t[near] - exact.stops[k]), x[near] - exact.points[k]
    start = [0.0, 0.0, *np.tile([(-1) ** k * 1e-3, 0.0, 0.0][: order - 1], 2)]
    fit = least_squares(
        lambda p: (piecewise(p, phase, order) - values) / 5e-9, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    error = np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac)))
    (time,), (point,) = refine(exact.t, x, guess[k], omega, [(width[k], order)])
    assert time == pytest.approx(exact.stops[k] + fit.x[0] / omega, abs=0.1 * error[0] / omega)
    assert point == pytest.approx(exact.points[k] + fit.x[1], abs=0.1 * error[1])


def test_a_window_without_samples_gives_the_guess():
    exact, x = swinging(10_000)
    time, point = refine(exact.t, x, [-1.0, 0.5, 3.0], 80.0, [(1e-5, 4)])
    assert time == pytest.approx([-1.0, 0.5, 3.0], abs=0)
    assert point == pytest.approx(np.interp([-1.0, 0.5, 3.0], exact.t, x), abs=0)


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


@pytest.mark.parametrize(
    ("rate", "samples"), [(150.0, 60), (300.0, 150), pytest.param(1000.0, 150, marks=pytest.mark.slow)]
)
def test_a_spike_near_the_release_of_a_coarse_record(rate, samples):
    """A spike of the amplitude causes a refusal or finite values."""
    t = np.arange(samples) / rate
    for frequency, band in ((5.0, 0.45), (5.0, 0.6), (9.0, 0.29), (14.2, 0.29), (14.2, 0.45)):
        for spike in range(12):
            exact = coulomb_viscous(t, 1e-3, frequency=frequency, zeta=0.0, dead_band=1e-3 * band)
            x = exact.x + 1e-3 * (np.arange(samples) == spike)
            try:
                segmentation = segment(t, x)
            except DataError as error:
                assert "sample faster" in str(error) or "as where spikes hide it" in str(error)
            else:
                assert 0 < segmentation.half_period < t[-1]
