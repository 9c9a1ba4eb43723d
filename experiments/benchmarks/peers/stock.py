"""Peer: optimistix's Levenberg-Marquardt over diffrax's Tsit5, unmodified.

It runs on one record or under vmap. The parameters are in units of their start values, because the stock solver damps
all of them alike.
"""

from typing import Any

import diffrax
import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import optimistix as optx  # noqa: E402
from record import Record  # noqa: E402
from rig import LOAD, MASS, NOISE, V_S  # noqa: E402

from peers.least_squares import TYPICAL, Outcome  # noqa: E402

# With rtol 1e-8 most fits of the archive miss the optimum, because the steps vary erratically with the parameters.
RTOL, ATOL = 1e-9, 1e-13
FIT_TOLERANCE = 1e-4


def rates(_t: Any, y: jax.Array, p: jax.Array) -> jax.Array:
    """Compute rates of displacement and velocity under the regularised law."""
    mu, damping, stiffness = p[:3]
    return jnp.stack([y[1], -(stiffness * y[0] + damping * y[1] + mu * LOAD * jnp.tanh(y[1] / V_S)) / MASS])


def displacement(t: jax.Array, p: jax.Array) -> jax.Array:
    """Compute the displacement with offset [m], shape (n,)."""
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(rates),  # pyright: ignore[reportArgumentType]
        diffrax.Tsit5(),
        t0=t[0],
        t1=t[-1],
        dt0=None,
        y0=jnp.stack([p[3], jnp.zeros(())]),
        args=p,
        saveat=diffrax.SaveAt(ts=t),
        stepsize_controller=diffrax.PIDController(rtol=RTOL, atol=ATOL),
        adjoint=diffrax.ForwardMode(),
        max_steps=100_000,
    )
    return found.ys[:, 0] + p[4]  # pyright: ignore[reportOptionalSubscript]


def residual(q: jax.Array, args: tuple[jax.Array, ...]) -> jax.Array:
    t, x, scale = args
    return (displacement(t, q * scale) - x) / NOISE


def solve(t: jax.Array, x: jax.Array, start: jax.Array, scale: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return fitted parameters and the number of steps."""
    solver = optx.LevenbergMarquardt(rtol=FIT_TOLERANCE, atol=FIT_TOLERANCE)
    found = optx.least_squares(residual, solver, start / scale, (t, x, scale), max_steps=200, throw=False)
    return found.value * scale, found.stats["num_steps"]


one = jax.jit(solve)
many = jax.jit(jax.vmap(solve, in_axes=(None, 0, 0, 0)))


def simulate(record: Record) -> np.ndarray:
    """Simulate the displacement [m] at the true values."""
    p = jnp.array([record.truth[name] for name in record.names])
    return np.asarray(jax.jit(displacement)(jnp.asarray(record.t), p))


def fit(record: Record) -> Outcome:
    """Fit one record."""
    start, scale = coordinates(record)
    return outcome(record, *one(record.t, record.x, start, scale))


def fit_all(records: list[Record]) -> list[Outcome]:
    """Fit all records in one vmapped call."""
    start, scale = map(np.array, zip(*map(coordinates, records), strict=True))
    found, steps = many(records[0].t, np.array([r.x for r in records]), start, scale)
    return [outcome(*row) for row in zip(records, found, steps, strict=True)]


def coordinates(record: Record) -> tuple[np.ndarray, np.ndarray]:
    """Return start and typical size of the parameters."""
    start = np.array([record.start[name] for name in record.names])
    return start, np.array([record.start[name] or TYPICAL[name] for name in record.names])


def outcome(record: Record, values: Any, steps: Any) -> Outcome:
    return Outcome(dict(zip(record.names, map(float, values), strict=True)), int(steps))
