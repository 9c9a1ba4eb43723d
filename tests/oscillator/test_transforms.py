"""Derivatives of motions under the transformations of JAX.

Each case is a law, an engine and a transformation. The function that is differentiated has all outputs of the motion.
"""

import functools
from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import AbstractFriction, Coulomb, LuGre, Stribeck, Tanh
from fricjax.oscillator import Oscillator, final_displacement, simulate
from fricjax.oscillator.select import select_engine
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS, central_differences
from tests.tiers import cases

TS = jnp.linspace(0.0, 0.3, 13)
X0, STIFFNESS = 2e-3, 2574.0
AT = jnp.asarray([0.05, 1.0])
"""Friction coefficient, and a factor of the stiffness and the initial displacement."""

LAWS: dict[str, Callable[[Any], AbstractFriction]] = {
    "Coulomb": lambda mu: Coulomb(mu, 0.055),
    "Stribeck": lambda mu: Stribeck(mu, 0.06, 1e-2),
    "Tanh": lambda mu: Tanh(mu, 1e-3),
    "LuGre": lambda mu: LuGre(mu, sigma0=1e5, sigma1=280.0),
}
SOLVED_BY = {
    "Coulomb": ("exact", "hybrid", "diffrax"),
    "Stribeck": ("hybrid", "diffrax"),
    "Tanh": ("hybrid", "smooth", "diffrax"),
    "LuGre": ("smooth", "diffrax"),
}


def machine(law: str, mu: Any, stiffness: Any = STIFFNESS) -> Oscillator:
    return Oscillator(PROTOTYPE_MASS, stiffness, PROTOTYPE_DAMPING, 9.66, LAWS[law](mu))


@functools.cache
def outputs(law: str, engine: str) -> Callable[..., Any]:
    """All outputs of a motion as a function of two numbers."""
    # Steps that adapt in time differ from program to program, within the accuracy.
    accuracy = 1e-10 if engine in ("exact", "hybrid") else 1e-12
    example = machine(law, 0.05)
    chosen, rests = select_engine(engine, example, accuracy=accuracy, max_half_cycles=16), example.friction.set_valued

    def values(p: Any, ts: Any = TS) -> Any:
        motion = simulate(machine(law, p[0], STIFFNESS * p[1]), X0 * p[1], ts, engine=chosen)
        stop = [jnp.reshape(motion.t_stop, (1,))] if rests else []
        return jnp.concatenate([motion.x / X0, motion.v, motion.friction_force, motion.turning_points[:5] / X0, *stop])

    return values


def summed(values: Any) -> Any:
    """One number that depends on all outputs, along the first axis."""
    return jnp.tensordot(jnp.sin(jnp.arange(len(values))), values, axes=1)


def total(law: str, engine: str) -> Callable[[Any], Any]:
    return lambda p: summed(outputs(law, engine)(p))


@functools.cache
def forward(law: str, engine: str) -> Callable[..., Any]:
    """The derivatives of all outputs in forward mode."""
    return jax.jacfwd(outputs(law, engine))


@functools.cache
def gradient(law: str, engine: str) -> np.ndarray:
    """The derivative of :func:`total` in forward mode."""
    return np.asarray(summed(forward(law, engine)(AT)))


def close(found: Any, expected: Any, rtol: float) -> None:
    scale = np.max(np.abs(expected))
    assert np.all(np.isfinite(found)) and scale > 0
    np.testing.assert_allclose(found, expected, rtol=0, atol=rtol * scale)


def by_differences(*case: str) -> None:
    close(forward(*case)(AT), central_differences(jax.jit(outputs(*case)), AT, 1e-4)[0].T, 1e-6)


def by_jacrev(*case: str) -> None:
    close(jax.jacrev(outputs(*case))(AT), forward(*case)(AT), 1e-9)


def by_grad(*case: str) -> None:
    close(jax.grad(total(*case))(AT), gradient(*case), 1e-9)


def by_jit(*case: str) -> None:
    # A jitted program may adapt other steps, so it is compared with a jitted one.
    close(jax.jit(jax.grad(total(*case)))(AT), summed(jax.jit(forward(*case))(AT)), 1e-9)


BATCH = jnp.stack([AT, 1.02 * AT])


def by_vmap_of_grad(*case: str) -> None:
    close(jax.vmap(jax.grad(total(*case)))(BATCH)[0], gradient(*case), 1e-9)


def by_grad_of_vmap(*case: str) -> None:
    found = jax.grad(lambda batch: jnp.sum(jax.vmap(total(*case))(batch)))(BATCH)[0]
    close(found, gradient(*case), 1e-9)


def by_hessian(*case: str) -> None:
    second = central_differences(lambda p: summed(forward(*case)(p)), AT, 1e-4)[0]
    close(jax.jit(jax.hessian(total(*case)))(AT), second, 1e-4)


def by_times(*case: str) -> None:
    n = TS.size
    rates = jax.jit(jax.jacrev(lambda ts: outputs(*case)(AT, ts)[:n] * X0))(TS)
    close(rates, np.diag(np.asarray(outputs(*case)(AT)[n : 2 * n])), 1e-6)


def by_filter_grad(law: str, engine: str) -> None:
    def last(oscillator: Oscillator) -> Any:
        # The closed form has no derivative with respect to drag, so "auto" takes another engine for it.
        return simulate(oscillator, X0, TS).x[3] / X0

    leaves = eqx.filter_grad(last)(machine(law, AT[0]))
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(leaves))
    assert leaves.friction.mu == pytest.approx(float(forward(law, engine)(AT)[3, 0]), rel=1e-6)


TRANSFORMS = {
    check.__name__: check
    for check in (
        by_differences, by_jacrev, by_grad, by_jit, by_vmap_of_grad, by_grad_of_vmap, by_hessian, by_times,
        by_filter_grad,
    )
}  # fmt: skip
# An engine that is not the first choice for its law takes fewer transformations, since compilation takes long.
OTHERS = ("by_differences", "by_jacrev", "by_vmap_of_grad")
CASES = [
    (law, engine, transform)
    for law, engines in SOLVED_BY.items()
    for engine in engines
    for transform in (TRANSFORMS if engine == engines[0] else OTHERS)
]
CORE = [("Coulomb", "exact", transform) for transform in ("by_differences", "by_jacrev", "by_vmap_of_grad", "by_times")]


@pytest.mark.parametrize("case", cases(CASES, CORE), ids=lambda case: "-".join(case))
def test_all_modes_agree(case: tuple[str, str, str]):
    law, engine, transform = case
    TRANSFORMS[transform](law, engine)


def rest(law: str, p: Any) -> Any:
    return final_displacement(machine(law, p[0], STIFFNESS * p[1]), X0 * p[1]) / X0


@pytest.mark.parametrize("law", cases(("Coulomb", "Stribeck", "LuGre"), ["Coulomb"]))
def test_final_displacements_are_differentiated_in_both_modes(law: str):
    starts = jnp.stack([AT, AT * jnp.asarray([1.0, 1.3])])
    value = functools.partial(rest, law)
    found = jax.vmap(jax.grad(value))(starts)
    close(found, jax.vmap(jax.jacfwd(value))(starts), 1e-9)
    close(found[0], central_differences(jax.jit(value), AT, 1e-4)[0], 1e-6)


@pytest.mark.slow
def test_a_driven_motion_is_differentiated_in_both_modes():
    floor = 0.5 * jnp.sin(60.0 * TS)

    def displacement(p: Any) -> Any:
        driven = machine("Tanh", p[0])
        return simulate(driven, X0, TS, base_acceleration=p[1] * floor, accuracy=1e-12).x / X0

    jacobian = jax.jacrev(displacement)(AT)
    close(jacobian, jax.jacfwd(displacement)(AT), 1e-9)
    close(jacobian, central_differences(jax.jit(displacement), AT, 1e-4)[0].T, 1e-6)
