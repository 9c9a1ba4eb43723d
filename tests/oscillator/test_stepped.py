"""Steps to given instants, against the same solvers in diffrax's loop."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.oscillator import Rodas5P
from fricjax.oscillator.engines.smooth.mesh import Steps, stepped

ENDS = np.array([0.3, 0.35, 0.5, 0.8, 1.0, 1.6, 1.6, 1.6])
Y0 = (jnp.asarray(1.0), jnp.asarray(-0.5))


def van_der_pol(t, y, stiffness):
    return y[1], stiffness * (1 - y[0] ** 2) * y[1] - y[0] + jnp.sin(t)


def given(solver, ends, count, stiffness):
    steps = Steps(jnp.asarray(ends[:-1]), jnp.asarray(ends[1:]), jnp.asarray(count))
    return stepped(van_der_pol, solver, steps, Y0, lambda i, y: (y, stiffness))


def by_diffrax(solver, stiffness):
    made = jnp.asarray(ENDS[:6])
    return diffrax.diffeqsolve(
        diffrax.ODETerm(van_der_pol), solver, made[0], made[-1], dt0=None, y0=Y0, args=stiffness,
        stepsize_controller=diffrax.StepTo(made), saveat=diffrax.SaveAt(ts=made), adjoint=diffrax.ForwardMode(),
    ).ys  # fmt: skip


@pytest.mark.parametrize(
    "solver", [Rodas5P(), diffrax.Dopri8(scan_kind="lax")], ids=lambda solver: type(solver).__name__
)
def test_states_and_their_derivatives_are_those_of_diffrax(solver):
    stiffness, along = jnp.asarray(2.0), jnp.asarray(1.0)
    ours = lambda value: given(solver, ENDS, 5, value)
    both = (jax.jvp(f, (stiffness,), (along,)) for f in (ours, lambda value: by_diffrax(solver, value)))
    for found, expected in zip(*both, strict=True):
        for values, reference in zip(found, expected, strict=True):
            # The end of the last step is repeated.
            np.testing.assert_allclose(values, np.r_[reference, [reference[-1]] * 2], rtol=1e-13, atol=1e-15)


def test_a_list_of_one_instant_takes_no_step():
    found = given(Rodas5P(), np.full(4, 0.7), 0, jnp.asarray(2.0))
    for values, begin in zip(found, Y0, strict=True):
        np.testing.assert_array_equal(values, np.full(4, begin))
