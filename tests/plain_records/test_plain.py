"""Fits of plain records, and the proof that they are plain."""

import dataclasses

import numpy as np
import pytest
from scipy.signal import lfilter

import fricjax as fj
from fricjax.plain import COEFFICIENTS, ITERATIONS, fit_plain
from tests.machines import MACHINE, X0, coulomb_run, oscillator
from tests.machines import RIGS as MACHINES
from tests.oracles import coulomb_viscous

RATE, SAMPLES, NOISE, LOAD = 5e3, 6000, 5e-9, 1.89
RIG = fj.Oscillator(0.41, 2574.0, 0.17, LOAD, fj.friction.Coulomb(0.05))
T = np.arange(SAMPLES) / RATE
PASSES = ITERATIONS + 1
FREE = ("mu", "damping", "stiffness")


def decay(x0: float = X0, mu: float = 0.05):
    frequency, band = np.sqrt(2574.0 / 0.41) / (2 * np.pi), mu * LOAD / 2574.0
    return coulomb_viscous(T, x0, frequency=frequency, zeta=float(RIG.damping_ratio), dead_band=band)


def motion(x0: float = X0) -> np.ndarray:
    return decay(x0).x


def noisy(seed: int, x: np.ndarray | None = None) -> np.ndarray:
    x = motion() if x is None else x
    return x + NOISE * np.random.default_rng(seed).standard_normal(x.size)


def plain(x: np.ndarray, free=FREE, sigma: float | None = NOISE, **changes: float):
    known = {name: float(getattr(RIG, name)) for name in COEFFICIENTS if name != "mu"} | {"mu": 0.04} | changes
    machine = {name: np.full(len(x), value) for name, value in known.items()}
    return fit_plain(x, 1 / RATE, machine, free, None if sigma is None else np.full(len(x), sigma))


@pytest.mark.parametrize("free", [FREE, ("mu", "damping", "mass"), ("normal_force", "damping", "stiffness"), ("mu",)])
def test_derivatives_are_finite_differences(free):
    x = noisy(0)[None]
    fits = plain(x, free)
    assert fits.runs.tolist() == [0]
    step = 1e-6 * np.abs(fits.values[0])
    step[-1] = 1e-12
    slopes = []
    for place, h in enumerate(step):
        moved = [fits.values[0].copy() for _ in range(2)]
        for sign, values in zip((1, -1), moved, strict=True):
            values[place] += sign * h
        up, down = (_model(free, values, int(fits.at.begins[0, 0])) for values in moved)
        slopes.append((up - down) / (2 * h))
    normal = np.array(slopes) @ np.array(slopes).T
    size = np.sqrt(np.outer(np.diag(normal), np.diag(normal)))
    np.testing.assert_allclose(fits.normal[0] / size, normal / size, atol=1e-6)


def _model(free, values, begin: int) -> np.ndarray:
    """The motion from the first fitted sample, by the oracle."""
    m = {"mass": 0.41, "stiffness": 2574.0, "damping": 0.17, "normal_force": LOAD, "mu": 0.04}
    m |= dict(zip(free, values, strict=False))
    t0, x0, offset = values[-3:]
    frequency = np.sqrt(m["stiffness"] / m["mass"]) / (2 * np.pi)
    ratio = m["damping"] / (2 * np.sqrt(m["stiffness"] * m["mass"]))
    band = m["mu"] * m["normal_force"] / m["stiffness"]
    return offset + coulomb_viscous(T[begin:], x0, frequency=frequency, zeta=ratio, dead_band=band, release=t0).x


HOW = [
    ("rolling", 0.0, None, "first_reversal"),
    ("sliding", 0.02, None, "first_reversal"),
    ("rolling", 0.0, 0.012, "release"),
]


@pytest.mark.parametrize(("rig", "hold", "mu_s", "start"), HOW)
def test_estimates_are_those_of_the_general_way(rig, hold, mu_s, start):
    # An engine by name selects the general way.
    data = MACHINES[rig]
    trace = coulomb_run(
        2.3e-3, mu=data.mu, mu_s=mu_s, load=data.load, rate=5e3, samples=6000, noise=3e-9, hold=hold, offset=1e-4
    )
    machine = dataclasses.replace(oscillator(data, "Coulomb"), friction=fj.friction.Coulomb(data.mu, mu_s))
    fast, slow = (fj.fit(trace, machine, MACHINE, start=start, engine=engine) for engine in ("auto", "exact"))
    assert fast.passes == PASSES and fast.converged and slow.converged
    assert fast.names == slow.names and fast.half_cycles == slow.half_cycles
    for name in fast.names:
        assert abs(fast.values[name] - slow.values[name]) < 1e-3 * slow.std_errors[name], name
        assert fast.std_errors[name] == pytest.approx(slow.std_errors[name], rel=1e-3), name
    for name, each in fast.kinematics.items():
        assert each.std == pytest.approx(slow.kinematics[name].std, rel=1e-3, abs=1e-30), name
    np.testing.assert_allclose(fast.predict(trace.t[-2000:]), slow.predict(trace.t[-2000:]), atol=1e-12)
    if slow.margins[0] is not None:
        assert fast.margins[0] == pytest.approx(slow.margins[0], rel=1e-3)
    assert fast.units == slow.units and fast.flags == slow.flags and fast.warnings == slow.warnings


def test_uncertain_inputs_contribute_as_in_the_general_way():
    rig = fj.Rig(mass=fj.Measured(0.41, 1e-4), stiffness=fj.Measured(2574.0, 2.0), normal_force=fj.Measured(1.89, 5e-3))
    machine = dataclasses.replace(rig, damping=fj.Measured(0.17, 0.01)).oscillator(fj.friction.Coulomb(0.05))
    rig = dataclasses.replace(rig, damping=fj.Measured(0.17, 0.01))
    trace = fj.Trace(T, noisy(0), sigma=NOISE)
    for free in (("mu", "damping", "stiffness"), ("mu", "stiffness")):
        fast, slow = (fj.fit(trace, machine, free, rig=rig, engine=engine) for engine in ("auto", "exact"))
        assert fast.passes == PASSES
        for name in fast.contributions:
            for source, part in slow.contributions[name].items():
                error = slow.combined_std_errors.get(
                    name, slow.kinematics[name].std if name in slow.kinematics else 0.0
                )
                assert fast.contributions[name][source] == pytest.approx(part, rel=1e-4, abs=1e-6 * error), (
                    name,
                    source,
                )
    batch = fj.fit_batch([trace, trace], machine, FREE, rig=rig)
    single = fj.fit(trace, machine, FREE, rig=rig)
    for name in FREE:
        assert batch.combined_std_errors[name][1] == pytest.approx(single.combined_std_errors[name], rel=1e-9)


def test_a_batch_gives_the_numbers_of_single_fits():
    runs = [coulomb_run(x0, mu=0.02, samples=6000, seed=seed) for seed, x0 in enumerate((1.5e-3, 2e-3, 2.5e-3))]
    runs.append(fj.Trace(runs[0].t, np.asarray(runs[0].x) + 1e-6 * np.sin(300 * np.asarray(runs[0].t))))
    machine = oscillator(MACHINES["sliding"], "Coulomb")
    batch = fj.fit_batch(runs, machine, MACHINE)
    assert batch.passes[:3].tolist() == 3 * [PASSES] and batch.passes[3] != PASSES
    for i, run in enumerate(runs[:3]):
        fit = fj.fit(run, machine, MACHINE)
        for name in fit.names:
            assert batch.values[name][i] == pytest.approx(fit.values[name], rel=1e-12)
            assert batch.std_errors[name][i] == pytest.approx(fit.std_errors[name], rel=1e-9)
        for name, each in fit.kinematics.items():
            assert batch.kinematics[name][i] == pytest.approx(each.value, rel=1e-12)
            assert batch.kinematics_std[name][i] == pytest.approx(each.std, rel=1e-6)
        assert batch.chi2[i] == pytest.approx(fit.chi2, rel=1e-9)
        assert (batch.dof[i], batch.half_cycles[i]) == (fit.dof, fit.half_cycles[0])
        assert (batch.flags[i], batch.warnings[i], batch.units) == (fit.flags, fit.warnings, fit.units)


def test_plain_records_pass_with_honest_errors():
    x = np.stack([noisy(seed, motion(x0)) for seed, x0 in enumerate(np.linspace(1.2e-3, 2.6e-3, 60))])
    fits = plain(x)
    assert fits.runs.size >= 57
    z = (fits.values[:, :3] - [0.05, 0.17, 2574.0]) / (
        NOISE * np.sqrt(np.diagonal(fits.inverse, axis1=1, axis2=2))[:, :3]
    )
    assert np.all(np.abs(np.sqrt(np.mean(z**2, axis=0)) - 1) < 0.35)


RANDOM = np.random.default_rng(5)
WHITE = NOISE * RANDOM.standard_normal(SAMPLES)
JITTER = np.asarray(np.diff(motion(), append=0.0)) * RATE * RANDOM.standard_normal(SAMPLES)
DISTURBED = {
    "size": motion() + 1.2 * WHITE,
    "neighbours": motion() + lfilter([1.0], [1.0, -0.3], WHITE),
    "memory at all lags": motion() + WHITE + lfilter([0.05], [1.0, -0.995], WHITE),
    "outliers": motion() + WHITE + 50e-9 * (np.arange(SAMPLES) == 3000),
    "repeated samples": 10e-9 * np.round((motion() + WHITE) / 10e-9),
    "lines": motion() + WHITE + NOISE * np.sin(2 * np.pi * 50 * T),
    "slow motion": motion() + WHITE + NOISE * T / T[-1],
    "time": motion() + WHITE * (0.6 + 0.8 * T / T[-1]),
    "speed": motion() + WHITE + 1e-7 * JITTER,
    "phase": motion() + WHITE + 1e-4 * motion() * (motion() / X0) ** 2,
}


@pytest.mark.parametrize("test", DISTURBED)
def test_a_disturbed_record_is_refused(test):
    fits = plain(DISTURBED[test][None])
    assert not fits.runs.size
    assert fits.refused[test].tolist() == [0]


def test_uneven_times_are_refused():
    jitter = 1e-7 * RANDOM.standard_normal(SAMPLES)
    machine = dataclasses.replace(RIG, friction=fj.friction.Coulomb(0.04))
    fit = fj.fit(fj.Trace(T + jitter, motion() + WHITE, sigma=NOISE), machine, FREE, throw=False)
    assert fit.passes != PASSES


def test_a_record_that_is_no_decay_is_left_to_the_general_way():
    x = np.stack([np.zeros(SAMPLES), WHITE, T, np.sin(80 * T), motion() + WHITE])
    assert plain(x).runs.tolist() == [4]


def test_negative_friction_is_refused():
    grown = 1e-3 * np.exp(-0.2 * T) * np.cos(79.2 * T) * (1 + 0.2 * T) + WHITE
    assert not plain(grown[None]).runs.size


def test_a_number_of_half_cycles_that_is_open_is_refused():
    low, high = X0, X0 + 4 * 0.05 * LOAD / 2574.0
    few = decay(low).points.size
    while high - low > 1e-10:
        middle = (low + high) / 2
        low, high = (middle, high) if decay(middle).points.size == few else (low, middle)
    # The last half-cycle moves the mass by less than the noise.
    fits = plain(noisy(0, motion(high))[None])
    assert not fits.runs.size
    assert fits.refused["number of half-cycles"].tolist() == [0] or fits.refused["stop"].tolist() == [0]
