"""Decays from tables against closed forms and DOP853, under NumPy and JAX."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.tables import cases as machines
from experiments.tables import oracle, run
from fricjax.friction import AbstractFriction, Coulomb, Spline, Stribeck, Tanh
from fricjax.oscillator import Oscillator
from fricjax.tables import (
    Layout,
    Start,
    Tabulation,
    choose_layout,
    decay,
    error,
    make_mesh,
    padded,
    solve,
    tabulate,
)
from tests.compilations import compilations
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import coulomb_viscous
from tests.tables import check_rows

M, K, C, LOAD, X0 = PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, 9.66, 2e-3
RATE = float(np.sqrt(K / M))
FREE = ("mu", "damping", "stiffness")
TS = np.linspace(-0.01, 0.35, 500)
FIXED = {case.name: case for case in machines.fixed()}


def machine(law: AbstractFriction) -> Oscillator:
    return Oscillator(M, K, C, LOAD, law)


def closed_form(mu: float = 0.02, damping: float = C, stiffness: float = K, x0: float = X0, mu_s: float = 0.024):
    omega = np.sqrt(stiffness / M)
    return coulomb_viscous(
        TS, x0, frequency=omega / (2 * np.pi), zeta=damping / (2 * np.sqrt(stiffness * M)),
        dead_band=mu * LOAD / stiffness, static_band=mu_s * LOAD / stiffness,
    )  # fmt: skip


@functools.cache
def coulomb(columns: int = 8):
    """Return tables, mesh and start of a Coulomb decay to rest.

    The turning points are off by a per cent.
    """
    oscillator, truth = machine(Coulomb(0.02, 0.024)), closed_form()
    forces = tabulate(oscillator, FREE, speed=1.2 * RATE * X0, travel=1.1 * X0, columns=columns)
    points = np.append(X0, truth.points) * (1 + 0.01 * np.cos(np.arange(truth.points.size + 1)))
    return forces, make_mesh(oscillator, forces, points), Start(X0, np.eye(columns)[-1])


def test_coulomb_decays_to_rest_like_its_closed_form():
    truth = closed_form()
    motion = decay(*coulomb(), TS, True)
    assert np.max(np.abs(motion.x - truth.x)) < 1e-13
    np.testing.assert_allclose(motion.turning_points, np.append(X0, truth.points), atol=1e-14)
    assert np.isclose(motion.duration, truth.stops[-1], rtol=1e-12)
    assert np.all(motion.excess[:-1] > 0) and motion.excess[-1] < 0
    moving = (TS > 0) & (truth.stops[-1] > TS)
    assert np.all(motion.v[~moving] == 0)
    assert motion.resolved


def test_the_velocity_is_the_slope_of_the_displacement():
    ts = np.linspace(0.01, 0.2, 300)
    shift = 1e-6
    before, now, behind = (decay(*coulomb(), ts + s, True) for s in (-shift, 0.0, shift))
    slope = (behind.x - before.x) / (2 * shift)
    # A reversal between the two times leaves an error of the jump of the acceleration times the shift.
    assert np.max(np.abs(now.v - slope)) < 30 * shift
    assert np.median(np.abs(now.v - slope)) < 1e-8


def test_columns_are_differences_of_the_closed_form():
    motion = decay(*coulomb(), TS, True)
    step = {"mu": 0.02, "damping": C, "stiffness": K, "x0": X0}
    columns = motion.columns[:, [0, 1, 2, 7]]
    for column, (name, value) in zip(columns.T, step.items(), strict=True):
        h = 1e-5 * value
        truths = [closed_form(**{name: value + s * h}).x for s in (1, -1)]
        differences = (truths[0] - truths[1]) / (2 * h)
        # At a reversal, and at the stop, the second derivative jumps, so a difference across it is off by part of h.
        assert np.max(np.abs(column - differences)) < 1e-4 * np.max(np.abs(column))
        assert np.median(np.abs(column - differences)) < 1e-9 * np.max(np.abs(column))


def test_numpy_and_jax_agree():
    forces, mesh, start = coulomb()
    host, compiled = (run(forces, mesh, start, TS, True) for run in (decay, solve))
    # NumPy stops the iterations at rounding error, so the last correction differs.
    host, compiled = (
        each._replace(quality=each.quality._replace(correction=np.zeros(()))) for each in (host, compiled)
    )
    for mine, theirs in zip(jax.tree.leaves(host), jax.tree.leaves(compiled), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-9, atol=1e-13 * np.max(np.abs(mine[np.isfinite(mine)])))


def test_padding_changes_nothing():
    forces, mesh, start = coulomb()
    size, count = padded(half_cycles=mesh.real.size, samples=TS.size), mesh.real.size
    oscillator = machine(Coulomb(0.02, 0.024))
    motion = decay(forces, mesh, start, TS, True)
    points = motion.turning_points
    wide = make_mesh(oscillator, forces, np.asarray(points), half_cycles=size.half_cycles)
    other = decay(forces, wide, start, size.fill(TS), True)
    assert np.max(np.abs(other.x[: TS.size] - motion.x)) < 1e-15
    np.testing.assert_allclose(other.columns[: TS.size], motion.columns, rtol=1e-9, atol=1e-13)
    assert np.isnan(other.turning_points[count + 1 :]).all() and np.isnan(other.excess[count + 1 :]).all()
    assert other.resolved


def test_a_second_law_compiles_nothing():
    laws = (Coulomb(0.02), Stribeck(0.02, 0.024, 3e-3), Tanh(0.02, 1e-4))
    with compilations() as programs:
        for law in laws:
            oscillator, before = machine(law), len(programs)
            tabulation = Tabulation(oscillator, ["mu", "stiffness"], 1.2 * RATE * X0, 1.1 * X0)
            forces = tabulation(tabulation.values)
            mesh = make_mesh(oscillator, forces, [X0, -1.8e-3, 1.6e-3], layout=Layout(2, 24), half_cycles=3)
            motion = solve(forces, mesh, Start(X0, np.eye(8)[7]), np.linspace(0.0, 0.07, 77), False)
            assert bool(motion.resolved), before
    assert len(programs) == 1, programs


def test_runs_are_batched():
    forces, mesh, start = coulomb()
    starts = Start(np.array([X0, 1.01 * X0, 0.99 * X0]), np.stack([start.columns] * 3))
    alone = [decay(forces, mesh, Start(x0, start.columns), TS, True) for x0 in starts.x0]
    together = jax.jit(jax.vmap(lambda one: decay(forces, mesh, one, jnp.asarray(TS), True, 6, jnp)))(starts)
    for i, motion in enumerate(alone):
        assert np.max(np.abs(together.x[i] - motion.x)) < 1e-14
        np.testing.assert_allclose(together.columns[i], motion.columns, rtol=1e-8, atol=1e-12)


def test_tangents_are_columns():
    forces, mesh, start = coulomb()
    ts = jnp.asarray(TS[TS > 0])

    def x(x0):
        return decay(forces, mesh, Start(x0, start.columns), ts, True, 6, jnp).x

    tangent = jax.jit(lambda x0: jax.jvp(x, (x0,), (1.0,))[1])(X0)
    np.testing.assert_allclose(
        tangent, decay(forces, mesh, start, TS[TS > 0], True).columns[:, 7], rtol=1e-6, atol=1e-6
    )


def test_no_motion_is_invented_after_the_last_half_cycle():
    forces, mesh, start = coulomb()
    motion = decay(forces, mesh, start, TS, False)
    assert np.array_equal(np.isnan(motion.x), motion.duration < TS)


def test_meshes_that_do_not_resolve_are_refused():
    forces, mesh, start = coulomb()
    with np.errstate(all="ignore"):
        # A release from inside the dead band has no half-cycle, and one iteration from wrong amplitudes is not enough.
        inside = decay(forces, mesh, Start(0.5 * 0.02 * LOAD / K, start.columns), TS, True)
        hasty = decay(forces, mesh._replace(amplitudes=1.2 * mesh.amplitudes), start, TS, True, 0)
        far = decay(forces, mesh, Start(1.5 * X0, start.columns), TS, True)
    assert not inside.resolved and not hasty.resolved and not far.resolved
    assert far.quality.speed > 1


def test_refusals_of_a_mesh():
    oscillator = machine(Coulomb(0.02))
    forces = tabulate(oscillator, [], speed=0.2, travel=X0)
    with pytest.raises(ValueError, match="A mesh for 1 half-cycles needs 2 to 2 turning points, got 3"):
        make_mesh(oscillator, forces, [1e-3, -8e-4, 6e-4], half_cycles=1)
    spline = machine(Spline((0.0, 1e-3, 1e-2, 0.05), (0.02, 0.019, 0.018, 0.018)))
    with pytest.raises(ValueError, match="The force has 3 kinks, too many for 2 panels"):
        make_mesh(spline, forces, [1e-3, -8e-4], layout=Layout(2, 32))


def test_layouts_follow_the_layer_of_the_law():
    def chosen(law: AbstractFriction) -> Layout:
        oscillator = machine(law)
        forces = tabulate(oscillator, ["stiffness"], speed=1.2 * RATE * X0, travel=X0)
        return choose_layout(oscillator, forces, [X0, -1.8e-3, 1.6e-3])

    assert chosen(Coulomb(0.02)) == Layout(2, 32)
    assert chosen(Stribeck(0.02, 0.024, 2e-3)) == Layout(2, 64)
    assert chosen(Stribeck(0.02, 0.024, 2e-3, 0.5)).grading < 1
    assert chosen(Spline((0.0, 1e-3, 1e-2, 0.05), (0.02, 0.019, 0.018, 0.018))).panels == 8


def _is_accurate(name: str) -> None:
    case = FIXED[name]._replace(half_cycles=min(FIXED[name].half_cycles, 4))
    row = run.measure(case, np.random.default_rng(0), derivatives=True)
    assert row["accepted"] and row["rest"]
    assert row["x"] < (run.LARGEST_LOOSE if case.loose else run.LARGEST)
    assert row["columns"] < run.LARGEST_COLUMN


def test_displacements_and_columns_are_those_of_the_variational_equations():
    names = ("Stribeck 2", "Tanh 1e-4", "structural", "structural, ends before the equilibrium", "pendulum, 2.4 rad")
    check_rows(_is_accurate, {name: (name,) for name in names})


@pytest.mark.slow
def test_those_of_the_other_machines_too():
    # A pendulum from 3.05 rad is left to other engines.
    check_rows(_is_accurate, {name: (name,) for name in FIXED if "3.05" not in name})


def test_half_cycles_that_barely_leave_rest_are_right_or_refused():
    def check(case: machines.Case) -> None:
        row = run.measure(case, np.random.default_rng(0), derivatives=False, rough=0.001)
        assert not row["accepted"] or row["x"] < run.LARGEST

    check_rows(check, {case.name: (case,) for case in machines.grazing(12)})


def test_a_second_mesh_estimates_the_error():
    oscillator = machine(Tanh(0.02, 1e-5))
    forces = tabulate(oscillator, FREE, speed=1.2 * RATE * X0, travel=1.1 * X0)
    start, ts = Start(X0, np.eye(8)[7]), np.linspace(0.0, 0.14, 200)
    truth = oracle.decay(oscillator, FREE, X0, ts)
    points = truth.turning_points[:5]
    for count in (16, 24, 32):
        meshes = [
            make_mesh(oscillator, forces, points, layout=Layout(2, count), check=check) for check in (False, True)
        ]
        motions = [decay(forces, mesh, start, ts, False) for mesh in meshes]
        actual = np.max(np.abs(motions[0].x - truth.x))
        assert 0.1 * actual < error(*motions).x < 10 * actual
