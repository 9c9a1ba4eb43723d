"""Motion at the points of a decay and at samples between."""

from typing import Any, NamedTuple

import numpy as np

from .forces import Forces, Values
from .lookup import columns_at, once
from .mesh import Mesh
from .phase import State, recursion, sum_before


class Start(NamedTuple):
    """Start from rest.

    Attributes:
        x0: initial displacement [m], shape (); it is on the side of the first half-cycle of the mesh.
        columns: derivative of `x0` by each column of the tables, shape (columns,).

    Examples:
        >>> import numpy as np
        >>> Start(2e-3, np.eye(8)[7]).columns.shape
        (8,)
    """

    x0: Any
    columns: Values


class Nodes(NamedTuple):
    """Motion at the nodes in order of time.

    Attributes:
        t: times [s], shape (nodes,).
        motion: x, v and a with their columns at fixed time, shape (nodes, 3, 1 + columns).
        end: last turning point with its columns, shape (1 + columns,).
        duration: time of the last turning point [s].
    """

    t: Any
    motion: Any
    end: Any
    duration: Any


def make_nodes(xp: Any, forces: Forces, mesh: Mesh, start: Start, state: State) -> Nodes:
    """Return the motion at the nodes and its columns."""
    rates, exponent = state.rates, state.exponent
    side, omega, real = mesh.side[:, None], mesh.omega[:, None], mesh.real
    resisting_columns = once(xp, columns_at(xp, forces.resisting, rates.speed_place))
    restoring_columns = once(xp, columns_at(xp, forces.restoring, rates.travel_place))
    source = resisting_columns - side * restoring_columns
    factor = once(xp, xp.exp(exponent))
    gain = (rates.growth_source * source * mesh.weight / factor) @ mesh.integral
    # The slope of the coordinate at the start carries the derivative of the initial displacement.
    first = mesh.side[0] * rates.slope[0, 0] * start.columns
    begin = recursion(xp, mesh, exponent[:, -1], factor[:, -1] * gain[..., -1], first)
    changes = once(xp, factor * (begin[..., None] + gain))
    t, duration = _elapsed(xp, real, (rates.lapse * mesh.weight) @ mesh.integral)
    lapse_changes = rates.lapse_slope * changes + rates.lapse_source * source
    t_columns = once(xp, _elapsed(xp, real, (lapse_changes * mesh.weight) @ mesh.integral)[0])
    v, a = -side * rates.speed, side * rates.resisting - rates.restoring
    x_columns = side * mesh.cosine * changes / rates.slope
    end_columns = x_columns[..., -1]
    x_columns = x_columns - v * t_columns
    v_columns = -side * omega * mesh.sine * changes - a * t_columns
    a_columns = side * resisting_columns - restoring_columns
    a_columns = a_columns - rates.resisting_slope * v_columns - rates.restoring_slope * x_columns
    pairs = ((rates.x, x_columns), (v, v_columns), (a, a_columns))
    motion = xp.stack([xp.concatenate([value[None], columns]) for value, columns in pairs])
    # Neighbouring panels share a point.
    motion = xp.take(motion, mesh.nodes, axis=-1, mode="clip")
    t = xp.take(xp.where(real[:, None], t, duration), mesh.nodes, axis=-1, mode="clip")
    last = xp.sum(real) - 1
    end = xp.concatenate([rates.x[last, -1][None], end_columns[:, last]])
    return Nodes(t.reshape(-1), xp.moveaxis(motion.reshape(*motion.shape[:2], -1), -1, 0), end, duration)


def _elapsed(xp: Any, real: Any, lapse: Any) -> tuple[Any, Any]:
    """Return the time at the points, and the duration of all half-cycles."""
    full = xp.where(real, lapse[..., -1], 0.0)
    return sum_before(xp, full)[..., None] + lapse, xp.sum(full, axis=-1)


def sample(xp: Any, nodes: Nodes, ts: Any, rests: Any) -> tuple[Any, Any, Any]:
    """Interpolate displacement, velocity and columns by quintic Hermite polynomials."""
    at = xp.clip(ts, 0.0, xp.where(xp.isnan(nodes.duration), xp.inf, nodes.duration))
    index = xp.clip(xp.searchsorted(nodes.t, at, side="right") - 1, 0, nodes.t.shape[-1] - 2)
    begin = xp.take(nodes.t, index, mode="clip")
    step = xp.take(nodes.t, index + 1, mode="clip") - begin
    # At a reversal two nodes have the same time, and the acceleration jumps.
    step = xp.where(step > 0, step, 1.0)
    weights, slopes = _hermite(xp, (at - begin) / step, step)
    left = xp.take(nodes.motion, index, axis=0, mode="clip")
    right = xp.take(nodes.motion, index + 1, axis=0, mode="clip")
    values = xp.einsum("sk,skc->sc", weights[:, :3], left) + xp.einsum("sk,skc->sc", weights[:, 3:], right)
    v = xp.sum(slopes[:, :3] * left[:, :, 0] + slopes[:, 3:] * right[:, :, 0], axis=-1)
    behind = ts > nodes.duration
    values = xp.where(behind[:, None], xp.where(rests, nodes.end, xp.nan), values)
    v = xp.where(behind, xp.where(rests, 0.0, xp.nan), xp.where(ts > 0, v, 0.0))
    return values[:, 0], v, values[:, 1:]


def sample_derivative(xp: Any, nodes: Nodes, ts: Any, order: int) -> tuple[Any, Any, Any]:
    """Interpolate a derivative of the displacement by time.

    It is the derivative of the quintic polynomials of :func:`sample`.

    Args:
        xp: `numpy` or `jax.numpy`.
        nodes: motion at the nodes.
        ts: times [s], shape (samples,). Before the first node and after the last half-cycle the mass is at rest.
        order: order of the derivative, from 1 to 3.

    Returns:
        The derivative [m/s^order], shape (samples,); its derivatives by the columns of the tables, shape (samples,
        columns); and its derivative by time, shape (samples,).
    """
    at = xp.clip(ts, 0.0, xp.where(xp.isnan(nodes.duration), xp.inf, nodes.duration))
    index = xp.clip(xp.searchsorted(nodes.t, at, side="right") - 1, 0, nodes.t.shape[-1] - 2)
    begin = xp.take(nodes.t, index, mode="clip")
    step = xp.take(nodes.t, index + 1, mode="clip") - begin
    step = xp.where(step > 0, step, 1.0)
    left = xp.take(nodes.motion, index, axis=0, mode="clip")
    right = xp.take(nodes.motion, index + 1, axis=0, mode="clip")
    moving = (ts > 0) & (ts <= nodes.duration)

    def derivative(order: int, columns: slice) -> Any:
        weights = _derivative_weights(xp, (at - begin) / step, step, order)
        values = xp.einsum("sk,skc->sc", weights[:, :3], left[:, :, columns])
        values = values + xp.einsum("sk,skc->sc", weights[:, 3:], right[:, :, columns])
        return xp.where(moving[:, None], values, 0.0)

    values = derivative(order, slice(None))
    return values[:, 0], values[:, 1:], derivative(order + 1, slice(1))[:, 0]


# Coefficients of the quintic Hermite polynomials in powers of the fraction of a step, in the order of `_hermite`.
_QUINTIC = np.array(
    [
        [1.0, 0.0, 0.0, -10.0, 15.0, -6.0],
        [0.0, 1.0, 0.0, -6.0, 8.0, -3.0],
        [0.0, 0.0, 0.5, -1.5, 1.5, -0.5],
        [0.0, 0.0, 0.0, 10.0, -15.0, 6.0],
        [0.0, 0.0, 0.0, -4.0, 7.0, -3.0],
        [0.0, 0.0, 0.0, 0.5, -1.0, 0.5],
    ]
)


def _derivative_weights(xp: Any, q: Any, step: Any, order: int) -> Any:
    """Return weights of (x, v, a) at both ends, shape (samples, 6)."""
    coefficients = np.polynomial.polynomial.polyder(_QUINTIC, order, axis=1)
    powers = xp.stack([q**k for k in range(coefficients.shape[1])], axis=-1)
    scale = xp.stack([xp.ones_like(step), step, step * step] * 2, axis=-1)
    return powers @ coefficients.T * scale / step[:, None] ** order


def _hermite(xp: Any, q: Any, step: Any) -> tuple[Any, Any]:
    """Return weights of (x, v, a) at the ends of a step.

    The first ones are for the value at the fraction q of the step, the second ones for the slope, shape (samples, 6).
    """
    q2, p = q * q, 1 - q
    q3, p3 = q2 * q, p * p * p
    rise = q3 * (10 - 15 * q + 6 * q2)
    values = (
        1 - rise,
        step * (q - q3 * (6 - 8 * q + 3 * q2)),
        step * step * 0.5 * q2 * p3,
        rise,
        -step * q3 * (4 - 7 * q + 3 * q2),
        step * step * 0.5 * q3 * p * p,
    )
    steep = 30 * q2 * p * p / step
    slopes = (
        -steep,
        1 - q2 * (18 - 32 * q + 15 * q2),
        step * 0.5 * q * p * p * (2 - 5 * q),
        steep,
        -q2 * (12 - 28 * q + 15 * q2),
        step * 0.5 * q2 * p * (3 - 5 * q),
    )
    return xp.stack(values, axis=-1), xp.stack(slopes, axis=-1)
