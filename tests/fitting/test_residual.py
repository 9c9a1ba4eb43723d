"""Residual of several runs against that of each, and parameter transforms."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.estimation.space import Parameter, ParameterSpace
from fricjax.fitting.mesh import with_mesh
from fricjax.fitting.residual import Residual
from tests.fitting.problem_of import problem_of
from tests.machines import MACHINE, RIGS, noisy, oscillator


def joint(law: str) -> Residual:
    rig = RIGS["sliding"]
    runs = [noisy("sliding", law, seed) for seed in range(3)]
    return with_mesh(problem_of(runs, oscillator(rig, law), MACHINE).condensed, jnp.zeros(3 + 3 * len(OWN[law])))


OWN = {"Coulomb": ("t_release", "x0", "offset"), "LuGre": ("x0", "v0", "offset")}


@pytest.mark.slow
@pytest.mark.parametrize("law", OWN)
def test_runs_of_one_shape_are_computed_as_each_for_itself(law):
    residual, step = joint(law), 1e-4 * np.arange(3 + 3 * len(OWN[law]))
    assert len({run.t.size for run in residual.runs}) == 1
    together = np.asarray(eqx.filter_jit(residual)(jnp.asarray(step)))
    values = residual.values(jnp.asarray(step))
    read = eqx.filter_jit(lambda r, run, y, i: r.observed(y, i, run).read(run.t))
    for i, run in enumerate(residual.runs):
        alone = run.weight * (read(residual, run, jnp.asarray(step), jnp.asarray(i)) - run.x)
        n = run.t.size
        np.testing.assert_allclose(together[i * n : (i + 1) * n], alone, rtol=1e-9, atol=1e-6)
        assert residual.run_parameters(values, i)["x0"] == values[3 + 3 * i + OWN[law].index("x0")]


def test_runs_that_differ_in_shape_are_computed_one_by_one():
    residual = joint("Coulomb")
    first = residual.runs[0]
    short = first._replace(t=first.t[:50], x=first.x[:50], weight=first.weight[:50])
    mixed = residual._replace(runs=(short, *residual.runs[1:]))
    found = mixed.each(lambda number, run: run.t.size, mixed.runs)
    assert found == [50, residual.runs[1].t.size, residual.runs[2].t.size]


@pytest.mark.parametrize("way", ["value", "logarithm", "inverse root"])
def test_coordinates_and_values_carry_each_other(way):
    space = ParameterSpace.build([Parameter("sigma0", "N/m", 2e5, 2e5, fitted_as=way)], [0], [], [()])
    values = np.array([3e4, 2e5, 5e9])
    q = [space.coordinates(value[None]) for value in values]
    assert q[1] == 0.0 and q[0] < 0 < q[2]
    np.testing.assert_allclose([space.values(jnp.asarray(at))[0] for at in q], values, rtol=1e-10)
    slope = [(space.values(jnp.asarray(at + 1e-7)) - space.values(jnp.asarray(at - 1e-7)))[0] / 2e-7 for at in q[:2]]
    np.testing.assert_allclose([space.slope(jnp.asarray(at))[0] for at in q[:2]], slope, rtol=1e-6)


def test_a_rigid_contact_lies_at_a_finite_place():
    space = ParameterSpace.build([Parameter("sigma0", "N/m", 2e5, 2e5, fitted_as="inverse root")], [0], [], [()])
    assert space.coordinates(np.array([np.inf]))[0] == 1.0
    assert space.coordinates(np.array([0.0]))[0] == -np.inf
