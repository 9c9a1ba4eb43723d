"""Stops in noisy and damaged records agree with closed-form decays."""

import itertools

import numpy as np
import pytest
from scipy.signal import lfilter

from fricjax.data import segment
from fricjax.data.segmentation import disturbance, half_cycles, stop, swing
from tests.oracles import Machine, coulomb_viscous, slide
from tests.tables import check_rows

RATE, FREQUENCY = 2500.0, 12.6
RUNS = 12


def coloured(rho, size):
    return lambda t, random: lfilter([np.sqrt(1 - rho**2)], [1, -rho], size * random.standard_normal(t.size))


def hum(frequency, size):
    return lambda t, random: (
        size * np.sin(2 * np.pi * (frequency * t + random.uniform())) + 1e-9 * random.standard_normal(t.size)
    )


def ringing(t, random):
    omega = 2 * np.pi * random.uniform(60, 300)
    return 20e-9 * np.exp(-0.01 * omega * t) * np.sin(omega * t) + 1e-9 * random.standard_normal(t.size)


# Noise of at least 20 nm on a release of 1 to 3 mm; the last half-cycle is larger than 5 um.
NOISES = {
    "white": lambda t, random: 20e-9 * random.standard_normal(t.size),
    "coloured": coloured(0.9, 20e-9),
    "slow": coloured(0.99, 100e-9),
    "random walk": lambda t, random: np.cumsum(5e-9 * random.standard_normal(t.size)),
    "hum": hum(50.0, 1e-7),
    "hum at the natural frequency": hum(FREQUENCY, 1e-7),
    "mode": ringing,
    "drift": lambda t, random: 10e-6 * t + 20e-9 * random.standard_normal(t.size),
    "spikes": lambda t, random: (
        np.where(random.uniform(size=t.size) < 0.01, 1e-5, 1e-9) * random.standard_normal(t.size)
    ),
}


def decay(seed, rest=0.4):
    """Return about twelve half-cycles with a clear stop.

    The release and the equilibrium are random.
    """
    random = np.random.default_rng(seed)
    while True:
        x0 = random.uniform(0.8e-3, 2.6e-3)
        t = np.arange(0, x0 / 2.4e-3 + rest, 1 / RATE) + random.uniform() / RATE
        offset = random.uniform(-1e-3, 1e-3)
        exact = coulomb_viscous(t, x0 + offset, frequency=FREQUENCY, zeta=0.0027, dead_band=4e-5, offset=offset)
        if abs(np.diff(exact.points)[-1]) > 5e-6:
            return exact


@pytest.mark.parametrize("noise", NOISES)
def test_the_stop_is_found_in_noise_of_any_colour(noise):
    for seed in range(RUNS):
        exact = decay(seed)
        found = segment(exact.t, exact.x + NOISES[noise](exact.t, np.random.default_rng(seed)))
        assert found.n_half_cycles == exact.n_half_cycles
        assert found.rest == pytest.approx(exact.stops[-1], abs=0.1 * exact.half_period)


def test_hundreds_of_strokes_overflow_nothing():
    t = np.arange(0, 14.0, 1 / RATE)
    exact = coulomb_viscous(t, 2e-3, frequency=FREQUENCY, zeta=1e-4, dead_band=3.1e-6)
    found = segment(t, exact.x + 20e-9 * np.random.default_rng(0).standard_normal(t.size))
    assert found.n_half_cycles == exact.n_half_cycles > 240


def test_noise_of_any_colour_is_seen_as_large_as_it_is():
    exact = decay(0, rest=2.0)
    for rho, size in ((0.0, 20e-9), (0.5, 20e-9), (0.9, 20e-9), (0.95, 100e-9)):
        found = segment(exact.t, exact.x + coloured(rho, size)(exact.t, np.random.default_rng(1)))
        assert found.noise == pytest.approx(size, rel=0.25)
        assert found.white_noise == pytest.approx(size * np.sqrt((1 - rho) / (1 + rho)), rel=0.5)
    found = segment(exact.t, exact.x + hum(50.0, 1e-7)(exact.t, np.random.default_rng(1)))
    frequency, size = found.lines[0]
    assert frequency == pytest.approx(50.0, abs=1.0)
    assert size == pytest.approx(1e-7, rel=0.2)


def test_a_stated_noise_changes_nothing_that_the_samples_tell():
    exact = decay(0)
    x = exact.x + NOISES["coloured"](exact.t, np.random.default_rng(0))
    for sigma in (1e-9, 1e-6, 1.0):
        found = segment(exact.t, x, sigma=sigma)
        assert found.n_half_cycles == exact.n_half_cycles
        assert found.noise == pytest.approx(20e-9, rel=0.35)


def test_a_rounded_rest():
    for bits, seed in itertools.product([10, 16], range(RUNS)):
        step = 1e-2 / 2**bits
        exact = decay(seed)
        if abs(np.diff(exact.points)[-1]) < 2 * step:
            continue
        found = segment(exact.t, step * np.round(exact.x / step))
        assert found.n_half_cycles == exact.n_half_cycles


def test_strong_noise_leaves_the_number_open():
    """White noise of 5 % hides the last half-cycles.

    The count is right, or the right one is among the alternatives.
    """
    hidden = 0
    for seed in range(RUNS):
        exact = decay(seed)
        found = segment(exact.t, exact.x + 1e-4 * np.random.default_rng(seed).standard_normal(exact.t.size))
        missing = exact.n_half_cycles - found.n_half_cycles
        assert missing in (0, *found.open)
        hidden += missing != 0
    assert hidden <= RUNS // 2


@pytest.mark.parametrize("noise", ["white", "coloured", "hum", "drift"])
def test_a_gap_hides_no_half_cycle(noise):
    for seed in range(6):
        exact = decay(seed)
        x = exact.x + NOISES[noise](exact.t, np.random.default_rng(seed))
        mask = np.abs(exact.t - 3.1 * exact.half_period) > 0.9 * exact.half_period
        assert segment(exact.t, x, mask=mask).n_half_cycles == exact.n_half_cycles


def test_clipped_tops_and_a_start_in_mid_swing():
    for seed in range(6):
        exact = decay(seed)
        x = exact.x + NOISES["coloured"](exact.t, np.random.default_rng(seed))
        clipped = np.clip(x, x.min() + 0.05 * np.ptp(x), x.max() - 0.05 * np.ptp(x))
        found = segment(exact.t, clipped)
        assert found.first_reversal is not None
        later = exact.stops > found.first_reversal + 0.5 * exact.half_period
        assert found.n_half_cycles_after_first_reversal == np.sum(later)
        late = exact.t > 1.4 * exact.half_period
        found = segment(exact.t[late], x[late])
        assert found.n_half_cycles == exact.n_half_cycles - 1
        assert found.first_reversal == pytest.approx(exact.stops[1], abs=0.01 * exact.half_period)


def test_beats_of_a_second_mode_are_no_half_cycles():
    exact = decay(2)
    second = 0.05e-3 * np.exp(-4 * exact.t) * np.cos(2 * np.pi * 71.3 * exact.t)
    found = segment(exact.t, exact.x + second + NOISES["white"](exact.t, np.random.default_rng(0)))
    assert abs(found.n_half_cycles - exact.n_half_cycles) <= 1


@pytest.mark.parametrize("x0", [0.4, 2.6, 3.05, 3.1])
def test_a_pendulum_whose_period_goes_with_its_swing(x0):
    t = np.arange(0, 16, 1 / 150)
    pendulum = Machine(1.0, 0.004, lambda x: 30.0 * np.sin(x), lambda v: 0.9, 0.9, drag=0.002)
    exact = slide(pendulum, x0, 0.0, t, rtol=1e-9)
    for seed in range(3):
        found = segment(t, exact.x + 1e-3 * np.random.default_rng(seed).standard_normal(t.size))
        count = min(found.turning_times.size, exact.times.size)
        assert abs(found.n_half_cycles - np.sum(exact.times <= t[-1])) <= 1
        assert found.turning_times[:count] == pytest.approx(exact.times[:count], abs=0.05)


def test_several_decays_in_one_record_end_the_clock(monkeypatch):
    """The predicted times of reversals stay few, even with a negative half-period."""
    exact = [decay(seed) for seed in range(3)]
    x = np.concatenate([each.x - each.x[0] for each in exact])
    t = np.arange(x.size) / RATE
    predicted = []
    reversal = half_cycles._reversal
    monkeypatch.setattr(half_cycles, "_reversal", lambda *args: predicted.append(args[1]) or reversal(*args))
    monkeypatch.setattr(half_cycles, "_small_period", lambda swing, edges: -0.1 * swing.half_period)
    segment(t, x + 20e-9 * np.random.default_rng(0).standard_normal(t.size))
    assert len(predicted) < 5 * t[-1] * 2 * FREQUENCY


THRESHOLDS = [
    (half_cycles, name) for name in ("SURE", "SOUGHT", "BELIEVED", "TINY", "ISOCHRONOUS", "FOLDS", "PER_HALF_CYCLE")
] + [(stop, name) for name in ("STANDS_OUT", "RINGING", "CREPT", "SHORTEST_REST", "CREEP")] + [
    (disturbance, name) for name in ("STRETCH", "RINGS", "LINE", "HALF_CYCLES", "SAMPLES")
] + [(swing, "SPIKE"), (swing, "FEW_SPIKES")]  # fmt: skip


@pytest.mark.parametrize(
    "noises", [pytest.param(["white"], id="white"), pytest.param(list(NOISES), marks=pytest.mark.slow, id="all")]
)
@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_factor_of_two_in_a_threshold_changes_nothing(factor, noises):
    decays = [decay(seed) for seed in range(len(noises))]
    noisy = [exact.x + NOISES[noises[i]](exact.t, np.random.default_rng(i)) for i, exact in enumerate(decays)]

    def check(module, name):
        value = getattr(module, name)
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(module, name, int(factor * value) if isinstance(value, int) else factor * value)
            found = [segment(exact.t, x).n_half_cycles for exact, x in zip(decays, noisy, strict=True)]
        assert found == [exact.n_half_cycles for exact in decays]

    check_rows(check, {name: (module, name) for module, name in THRESHOLDS})
