"""Tables of forces against the laws, and the NumPy interpreter against JAX."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import AbstractFriction, Coulomb, LuGre, MonotoneSpline, Stribeck, Tanh, Viscous
from fricjax.oscillator import Oscillator, restoring
from fricjax.tables import Tabulation, tabulate
from fricjax.tables.forces import Curve
from fricjax.tables.interpreter import evaluate
from tests.cases.memoryless import MEMORYLESS
from tests.tables import check_rows

SPEED, TRAVEL = 0.3, 2e-3


def machine(law: AbstractFriction, spring: restoring.AbstractRestoring | None = None) -> Oscillator:
    return Oscillator(0.4, 2500.0, 0.3, 9.0, law, restoring=spring or restoring.Linear(), drag=0.7)


def read(curve: Curve, at: np.ndarray, side: int, column: int | None = None) -> Any:
    cells = curve.centres.size
    cell = np.clip(np.searchsorted(curve.edges, at, side="right") - 1, 0, cells - 1)
    table = curve.value if column is None else curve.columns[:, column]
    local = (at - curve.centres[cell]) * curve.scales[cell]
    return sum(power * local**i for i, power in enumerate(table[:, cell + cells * (side > 0)]))


def exact(oscillator: Oscillator, speed: Any) -> np.ndarray:
    force = oscillator.dissipation(speed) + oscillator.friction.sliding_force(speed, oscillator.normal_force)
    return np.broadcast_to(np.asarray(force / oscillator.mass), speed.shape)


def test_every_law_is_tabulated_to_a_billionth():
    speeds = np.append(0.0, np.geomspace(1e-9, SPEED, 400))

    def check(law: AbstractFriction) -> None:
        oscillator = machine(law)
        forces = tabulate(oscillator, [], speed=SPEED, travel=TRAVEL)
        for side in (-1, 1):
            np.testing.assert_allclose(
                read(forces.resisting, speeds, side), exact(oscillator, speeds), rtol=1e-9, atol=1e-10
            )
        load, mass = oscillator.normal_force, oscillator.mass
        assert np.isclose(forces.static, float(law.static_force(load)) / mass)
        assert np.isclose(forces.breakaway, float(law.breakaway_force(load)) / mass)

    check_rows(check, {name: (case.law,) for name, case in MEMORYLESS.items()})


def test_columns_are_central_differences():
    oscillator = machine(Stribeck(0.1, 0.15, 5e-3, 1.5))
    names = ["mu", "v_stribeck", "exponent", "normal_force", "mass", "damping", "drag"]
    tabulation = Tabulation(oscillator, names, SPEED, TRAVEL)
    speeds = np.geomspace(1e-5, 0.29, 60)
    for column, value in enumerate(tabulation.values):
        changed = []
        for sign in (1, -1):
            values = tabulation.values.copy()
            values[column] += sign * 1e-5 * value
            changed.append(read(tabulation(values).resisting, speeds, 1))
        differences = (changed[0] - changed[1]) / (2e-5 * value)
        # The error of the difference is 1e-10/6 of the third derivative, and rounding 1e-16/1e-5.
        columns = read(tabulation(tabulation.values).resisting, speeds, 1, column)
        np.testing.assert_allclose(columns, differences, rtol=1e-7, atol=1e-8 * np.max(np.abs(differences)))


@pytest.mark.parametrize(
    "spring",
    [restoring.Cubic(3e8), restoring.Pendulum(), restoring.Structural(0.02)],
    ids=lambda spring: str(type(spring)),
)
def test_springs_differ_between_the_sides_by_their_internal_friction(spring: restoring.AbstractRestoring):
    oscillator = machine(Coulomb(0.1), spring)
    forces = tabulate(oscillator, ["stiffness"], speed=SPEED, travel=TRAVEL)
    x: Any = np.linspace(-TRAVEL, TRAVEL, 101)
    force, inner = (np.asarray(each) for each in (oscillator.restoring_force(x), oscillator.hysteresis(x)))
    for side in (-1, 1):
        expected = (force - side * inner) / oscillator.mass
        np.testing.assert_allclose(read(forces.restoring, x, side), expected, rtol=1e-10, atol=1e-10)


def test_kinks_are_edges():
    knots = (0.0, 1e-3, 1e-2, 0.2, 0.5)
    forces = tabulate(machine(MonotoneSpline(knots, (0.15, 0.14, 0.1, 0.12, 0.1))), [], speed=SPEED, travel=TRAVEL)
    assert set(knots[1:4]) <= set(forces.resisting.edges) and forces.resisting.edges.size == 129


def test_sizes_depend_on_no_law():
    laws = (Coulomb(0.1), Tanh(0.1, 1e-4) + Viscous(0.1), Stribeck(0.1, 0.12))
    shapes = {
        tuple(np.shape(leaf) for leaf in jax.tree.leaves(tabulate(machine(law), ["mu"], speed=SPEED, travel=TRAVEL)))
        for law in laws
    }
    assert len(shapes) == 1


def test_names_in_full_and_more_columns():
    oscillator = machine(Coulomb(0.1))
    assert Tabulation(oscillator, ["friction.mu"], SPEED, TRAVEL).values.tolist() == [0.1]
    assert tabulate(oscillator, ["mu"] * 8, speed=SPEED, travel=TRAVEL).resisting.columns.shape[1] == 16


def test_refusals():
    with pytest.raises(ValueError, match="laws without internal states, and LuGre has 1"):
        Tabulation(machine(LuGre(0.1)), ["mu"], SPEED, TRAVEL)
    with pytest.raises(ValueError, match=r"There is no coefficient 'moo'\. Choose one of mass"):
        Tabulation(machine(Coulomb(0.1)), ["moo"], SPEED, TRAVEL)
    with pytest.raises(ValueError, match="2 coefficients need as many columns, got 1"):
        Tabulation(machine(Coulomb(0.1)), ["mu", "damping"], SPEED, TRAVEL, columns=1)


def test_the_interpreter_evaluates_like_jax():
    def function(x, y):
        z = jnp.where(x > 0.5, jnp.tanh(x * y), jax.nn.sigmoid(x) ** 3)
        stacked = jnp.stack([z, jnp.clip(x, 0.2, y), jnp.sqrt(jnp.abs(x)) + jnp.maximum(x, 0.1)])
        rows = jnp.pad(stacked, ((0, 1), (1, 0)), constant_values=2.0)
        return jnp.cumsum(rows, axis=1) @ jnp.linspace(0.0, 1.0, rows.shape[1]), jnp.min(rows[::-1, 1:], axis=0), z**-2

    x, y = np.linspace(0.1, 1.0, 7), np.float64(0.7)
    program = jax.make_jaxpr(function)(x, y)
    for mine, theirs in zip(evaluate(program, x, y), jax.jit(function)(x, y), strict=True):
        np.testing.assert_allclose(mine, theirs, rtol=1e-14)


def test_the_interpreter_leaves_other_operations_to_jax():
    program = jax.make_jaxpr(lambda x: jax.scipy.special.erf(x))(0.5)
    np.testing.assert_allclose(evaluate(program, np.array([0.5]))[0], 0.5204998778, rtol=1e-9)
