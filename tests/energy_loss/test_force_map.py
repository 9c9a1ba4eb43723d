"""Friction force map against the laws of the simulated runs."""

import functools

import numpy as np
import pytest

from fricjax.data import Record, Trace
from fricjax.energy_loss.decay import HalfCycle, decay
from fricjax.energy_loss.force_map import friction_force_map
from fricjax.energy_loss.smoothing import smooth
from fricjax.errors import DataError, UsageError
from fricjax.friction import Coulomb, Stribeck
from fricjax.rig import Rig
from tests.energy_loss.runs import LOAD, OFFSET, RIG, campaign, run
from tests.oracles import coulomb_viscous

pytestmark = pytest.mark.slow

STRIBECK = Stribeck(0.05, 0.065, 5e-3)


@functools.cache
def stribeck_map():
    return friction_force_map(campaign(STRIBECK, 0.5e-3, 2e-3, 7), RIG, bins=np.geomspace(1e-3, 0.12, 30))


def truth(found, static=0.05):
    return np.sign(found.velocity) * LOAD * (0.05 + (static - 0.05) * np.exp(-((found.velocity / 5e-3) ** 2)))


def test_a_stribeck_curve_lies_within_its_uncertainties():
    found = stribeck_map()
    deviation = (found.force - truth(found, 0.065)) / found.std
    assert np.mean(np.abs(deviation) < 2) >= 0.9
    assert 0.3 < np.mean(deviation**2) < 1.5
    assert np.min(np.abs(found.velocity)) < 1.2e-3


def test_the_curve_is_sharp_at_the_stribeck_velocity():
    found = stribeck_map()
    near = np.abs(np.abs(found.velocity) - 5e-3) < 1e-3
    assert set(zip(found.direction[near], found.branch[near], strict=True)) == {(1, 1), (1, -1), (-1, 1), (-1, -1)}
    assert np.all(found.std[near] < 0.05 * np.abs(found.force[near]))


def test_runs_without_two_half_cycles_are_left_out_and_named():
    notes = stribeck_map().notes
    assert [note.split(":")[0] for note in notes] == [f"Left out run {i} (synthetic run)" for i in range(3)]
    assert len(stribeck_map().offsets) == 4


def test_the_offset_is_found_within_its_uncertainty():
    for offset in stribeck_map().offsets:
        assert abs(offset.value - OFFSET) < 3.5 * offset.std
        assert offset.std < 2e-8


def test_the_mean_over_a_campaign_is_the_coefficient():
    found = friction_force_map(campaign(Coulomb(0.05), 0.25e-3, 2e-3, 36, rate=10e3), RIG)
    assert found.mu.value == pytest.approx(0.05, rel=1e-4)
    assert abs(found.mu.value - 0.05) < 3.5 * found.mu.std
    deviation = (found.force - truth(found)) / found.std
    assert np.mean(np.abs(deviation) < 2) >= 0.9


@pytest.mark.parametrize("noise", [1e-9, 1e-8])
def test_the_standard_deviations_are_those_of_repeated_runs(noise):
    edges = [0, 2e-3, 5e-3, 1e-2, 5e-2, 0.1]
    maps = [friction_force_map(run(Coulomb(0.05), 2e-3, noise=noise, seed=s), RIG, bins=edges) for s in range(20)]
    forces, stds = (np.array([getattr(found, name) for found in maps]) for name in ("force", "std"))
    ratio = forces.std(axis=0, ddof=1) / stds.mean(axis=0)
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(0.9, abs=0.25)


def test_a_difference_between_the_directions_goes_into_the_offset_unless_it_is_given():
    record = run(Coulomb(0.05), 2e-3)
    known = friction_force_map(record, RIG, offset=OFFSET - 1e-6, bins=[0.02, 0.1])
    pull = 2574.0 * 1e-6
    assert np.all(np.abs(known.force - (known.direction * 0.483 - pull)) < 4 * known.std)
    assert np.all(known.std < 0.01 * pull)


def test_known_losses_are_subtracted():
    rig = RIG.replace(damping=0.3, drag=0.5)
    record = run(Coulomb(0.05), 2e-3, rig=rig)
    found = friction_force_map(record, rig, bins=[0.02, 0.05, 0.1])
    assert np.abs(found.force) == pytest.approx(0.483, rel=2e-4)
    bare = friction_force_map(record, rig.replace(damping=0.0, drag=0.0), bins=[0.02, 0.05, 0.1])
    extra = np.abs(bare.force) - (0.3 + 0.5 * np.abs(bare.velocity)) * np.abs(bare.velocity)
    assert extra == pytest.approx(0.483, rel=2e-3)


def test_smoothing_follows_a_quartic_exactly_and_knows_its_noise():
    t = np.arange(400) / 20e3
    x = np.polynomial.Polynomial([0.0, 0.0, 2.0, -40.0, 600.0])
    clean = smooth(HalfCycle(t, x(t), t[1], 1e-9, 1, 0.0, 0.02), 1e-3)
    assert clean.v == pytest.approx(x.deriv()(t), abs=1e-10)
    assert clean.a == pytest.approx(x.deriv(2)(t), abs=1e-6)
    rng = np.random.default_rng(0)
    noisy = [
        smooth(HalfCycle(t, x(t) + 1e-9 * rng.standard_normal(400), t[1], 1e-9, 1, 0.0, 0.02), 1e-3).a
        for _ in range(300)
    ]
    zero = np.zeros(400)
    assert np.std(noisy, axis=0) / clean.std((zero, zero, zero + 1)) == pytest.approx(1, abs=0.2)


def test_no_window_reaches_over_a_reversal():
    t, omega, band = np.arange(8000) / 20e3, 2 * np.pi * 12.6, 1.876e-4
    exact = coulomb_viscous(t, 2e-3, frequency=12.6, zeta=0.0, dead_band=band)
    half_cycles = decay(Record(t, exact.x + 1e-13 * np.random.default_rng(0).standard_normal(t.size))).half_cycles
    assert len(half_cycles) == exact.n_half_cycles - 1
    for half_cycle, begin, end in zip(half_cycles, exact.stops[:-1], exact.stops[1:], strict=True):
        assert begin - 1e-7 < half_cycle.t[0] < half_cycle.t[-1] < end + 1e-7
        # The acceleration jumps by 2 omega^2 band = 2.4 m/s^2 at a reversal.
        accelerations = -(omega**2) * (half_cycle.x + half_cycle.direction * band)
        assert smooth(half_cycle, 1e-3).a == pytest.approx(accelerations, abs=2e-3)


def test_dense_samples_are_averaged_in_blocks():
    sparse, dense = (friction_force_map(run(Coulomb(0.05), 2e-3, rate=rate), RIG) for rate in (50e3, 400e3))
    assert dense.mu.value == pytest.approx(0.05, rel=1e-5)
    assert dense.mu.std < sparse.mu.std


def test_the_report_shows_branches_and_units():
    found = stribeck_map()
    text = found.summary()
    assert "+ accelerating" in text and "- decelerating" in text and "mm/s" in text and "Left out run" in text
    assert "<table>" in found._repr_html_()
    assert len(found.plot().axes[0].containers) == 4
    plain = found.to_dict()
    assert plain["force"] == found.force.tolist()
    assert found.to_dataframe()["force_std"].tolist() == found.std.tolist()
    assert plain["mu"]["value"] == found.mu.value


def uneven(record):
    t = np.asarray(record.trace.t).copy()
    t[1::2] += 1e-5
    return Record(Trace(t, record.trace.x))


def masked(record):
    mask = np.ones(record.trace.n, bool)
    mask[100:110] = False
    return Trace(record.trace.t, record.trace.x, mask=mask)


@pytest.mark.parametrize(
    ("change", "says"),
    [(uneven, "even sampling, but intervals differ"), (masked, "10 samples are masked out")],
)
def test_uneven_sampling_is_refused(change, says):
    with pytest.raises(DataError, match=says):
        friction_force_map(change(run(Coulomb(0.05), 2e-3)), RIG)


@pytest.mark.parametrize(
    ("x0", "says"),
    [(0.3e-3, "The motion never turns round"), (0.6e-3, "Half-cycles after the first reversal: 1. At least 2")],
)
def test_too_few_half_cycles_are_refused(x0, says):
    record = run(Coulomb(0.05), x0)
    with pytest.raises(DataError, match=says):
        friction_force_map(record, RIG)
    with pytest.raises(DataError, match="None of the 2 records can be used"):
        friction_force_map([record, record], RIG)


@pytest.mark.parametrize(
    ("keywords", "says"),
    [
        ({"rig": RIG.replace(damping_ratio=None)}, "The rig has no damping"),
        ({"rig": "rig.toml"}, "rig must be a fricjax.Rig, got str"),
        ({"bins": 1}, "bins must be a whole number of at least 2"),
        ({"bins": [1e-3, 1e-3]}, "limits of bins must be speeds"),
        ({"no_contact": 1.0}, "A record cannot be made of float"),
        ({"records": 1.0}, "A record cannot be made of float"),
        ({"records": []}, "the list is empty"),
    ],
)
def test_wrong_arguments_get_a_sentence(keywords, says):
    given = {"records": run(Coulomb(0.05), 2e-3), "rig": RIG, **keywords}
    with pytest.raises(UsageError, match=says):
        friction_force_map(**given)


def test_a_rig_needs_its_mass():
    with pytest.raises(UsageError, match="mass"):
        Rig(mass=-1.0, stiffness=1.0, normal_force=1.0)
