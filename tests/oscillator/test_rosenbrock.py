"""The Rosenbrock solver on problems with known solutions."""

from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import LuGre
from fricjax.oscillator import Oscillator, Rodas5P, simulate


def stiff(t, y, rate):
    """Stiff problem of Prothero and Robinson.

    The solution is (sin t, cos t), and `rate` is the stiffness.
    """
    return (-rate * (y[0] - jnp.sin(t)) + jnp.cos(t), -rate * y[0] * (y[1] - jnp.cos(t)) - jnp.sin(t))


def nonlinear(t, y, _):
    """Nonlinear pair with the solution exp(sin t^2), exp(cos t^2)."""
    return (2 * t * y[0] * jnp.log(y[1]), -2 * t * y[1] * jnp.log(y[0]))


def run(field, y0, args, end: float, steps: int, saveat: diffrax.SaveAt, modes: int = 0) -> Any:
    return diffrax.diffeqsolve(
        diffrax.ODETerm(field), Rodas5P(modes), 0.0, end, end / steps, y0, args,
        saveat=saveat, stepsize_controller=diffrax.ConstantStepSize(), adjoint=diffrax.ForwardMode(), max_steps=4096,
    )  # fmt: skip


def error_at_the_end(steps: int) -> float:
    start = (jnp.ones(()), jnp.exp(jnp.ones(())))
    (a, b) = run(nonlinear, start, None, 2.0, steps, diffrax.SaveAt(t1=True)).ys
    return abs(float(a[0] - np.exp(np.sin(4)))) + abs(float(b[0] - np.exp(np.cos(4))))


@pytest.mark.slow
def test_order_five_on_a_nonautonomous_system():
    errors = [error_at_the_end(n) for n in (40, 80, 160)]
    order = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(order > 4.7)


@pytest.mark.slow
def test_dense_output_of_order_four():
    ts = np.linspace(0, 2, 333)
    exact = np.stack([np.exp(np.sin(ts**2)), np.exp(np.cos(ts**2))])

    def worst(steps: int) -> float:
        start = (jnp.ones(()), jnp.exp(jnp.ones(())))
        ys = run(nonlinear, start, None, 2.0, steps, diffrax.SaveAt(ts=jnp.asarray(ts))).ys
        return float(np.max(np.abs(np.stack(ys) - exact)))

    errors = np.array([worst(n) for n in (40, 80, 160)])
    assert np.all(np.log2(errors[:-1] / errors[1:]) > 3.7)


@pytest.mark.parametrize("rate", [1e3, 1e6])
def test_stiff_problems_keep_their_accuracy(rate: float):
    start = (jnp.sin(0.5), jnp.cos(0.5))

    def shifted(t, y, args):
        return stiff(t + 0.5, y, args)

    (a, b) = run(shifted, start, rate, 1.0, 50, diffrax.SaveAt(t1=True)).ys
    np.testing.assert_allclose([a[0], b[0]], [np.sin(1.5), np.cos(1.5)], rtol=1e-7)


def test_a_step_damps_what_is_infinitely_stiff():
    (a,) = run(lambda t, y, _: (-1e12 * y[0],), (jnp.ones(()),), None, 1.0, 1, diffrax.SaveAt(t1=True)).ys
    assert abs(float(a[0])) < 1e-8


@pytest.mark.slow
def test_what_has_no_rate_is_held_by_the_same_step():
    def field(t, y, _):
        return (-y[2] * y[0] + y[3], y[0] * y[3], jnp.zeros(()), jnp.zeros(()))

    def at_the_end(y0: tuple, modes: int) -> Any:
        return jnp.stack(run(field, y0, None, 1.0, 8, diffrax.SaveAt(ts=jnp.asarray([0.3, 1.0])), modes).ys)

    y0 = tuple(jnp.asarray(value) for value in (1.0, 0.5, 3.0, 0.7))
    for solved in (at_the_end, jax.jacfwd(at_the_end)):
        np.testing.assert_allclose(jnp.stack(solved(y0, 2)), jnp.stack(solved(y0, 0)), rtol=1e-13, atol=1e-13)


def test_error_estimate_chooses_the_steps():
    def solve(tolerance: float) -> Any:
        return diffrax.diffeqsolve(
            diffrax.ODETerm(nonlinear), Rodas5P(), 0.0, 2.0, None, (jnp.ones(()), jnp.exp(jnp.ones(()))),
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance), adjoint=diffrax.ForwardMode(),
        )  # fmt: skip

    for tolerance in (1e-6, 1e-9):
        (a, _) = solve(tolerance).ys
        assert abs(float(a[0]) - np.exp(np.sin(4))) < 30 * tolerance


@pytest.mark.slow
def test_the_loop_calls_no_library():
    machine = Oscillator(0.41, 2574.0, 0.17, 1.89, LuGre(0.01))

    def run_for(x0):
        return simulate(machine, x0, np.linspace(0, 0.1, 11)).x

    text = jax.jit(run_for).lower(jnp.asarray(2e-3)).compile().as_text() or ""
    assert "while" in text
    assert "lapack" not in text.lower()
