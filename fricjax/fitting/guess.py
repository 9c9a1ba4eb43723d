"""Start values from the decay: frequency from half-periods, losses from energies.

Each half-cycle loses ``U(a_n) - U(a_{n+1}) = F (a_n + a_{n+1}) + c int v^2 dt + drag int |v|^3 dt``. With the integrals
of a sinusoid this is linear in the friction force, the damping and the drag, so non-negative least squares over all
half-cycles separates them by their dependence on the amplitude. The half-cycles of a pendulum are not sinusoidal, so
its integrals and periods are computed exactly (:mod:`.envelope`).
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np

from ..data import Segmentation
from ..oscillator import Oscillator
from ..oscillator.restoring import Cubic, Pendulum
from .envelope import Envelope, envelope
from .window import equilibrium, extremes, non_negative

# Fewest reversals for which a negative damping or drag is significant, despite the noise of the readings.
_TELLING = 30
# Smallest friction relative to the mean loss. It must be positive, because the fit uses its logarithm.
_LEAST_SHARE = 1e-3
_QUADRATURE = np.cos(np.pi * (np.arange(32) + 0.5) / 32)


class _Decay(NamedTuple):
    """Amplitudes before and after each half-cycle, and its angular frequency."""

    before: np.ndarray
    after: np.ndarray
    omega: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        return (self.before + self.after) / 2


def guess_machine(
    oscillator: Oscillator,
    decays: Sequence[Segmentation],
    free: Sequence[str],
    values: Mapping[str, float],
    lower: Mapping[str, float] | None = None,
) -> dict[str, float]:
    """Return start values of the free coefficients of a machine.

    They cover mass, stiffness, the cubic coefficient of a spring, damping, drag, mu and normal_force. For a law with
    coefficients of other names, mu is the dynamic force over the load. `free` may also contain
    "returned", the energy that a contact gives back at each reversal [J].

    Args:
        oscillator: the machine, for its restoring force and its fixed coefficients.
        decays: segmentations of the records.
        free: kinds of the free parameters (last part of their names).
        values: value of each coefficient of the oscillator by kind.
        lower: lower bounds of damping and drag, if any.
    """
    parts = [part for part in map(_decay, decays) if part.before.size]
    if not parts:
        return {}
    decay = _Decay(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))
    at: dict[str, Any] = {name: np.float64(value) for name, value in values.items()}
    if isinstance(oscillator.restoring, Pendulum) and "returned" not in free:
        seen = _of_pendulum(oscillator, decays, free, at, lower or {})
        if seen is not None:
            return {name: float(seen[name]) for name in free if name in seen}
    if "k3" in free and "stiffness" in free and isinstance(oscillator.restoring, Cubic):
        at["stiffness"], at["k3"] = (at["mass"] * each for each in _cubic_spring(decay))
        oscillator = eqx.tree_at(lambda o: o.restoring, oscillator, Cubic(at["k3"]))
    ratio = float(np.median(decay.omega**2 / _stiffening(oscillator, decay.mean, at)))
    if "stiffness" in free:
        at["stiffness"] = at["mass"] * ratio
    elif "mass" in free:
        at["mass"] = at["stiffness"] / ratio
    at.update(_losses(oscillator, decay, free, at))
    return {name: float(at[name]) for name in free if name in at}


def _cubic_spring(decay: _Decay) -> tuple[float, float]:
    """Return k/m and k3/m from frequencies and amplitudes, by harmonic balance.

    ``omega^2 = (k + 3/4 k3 a^2)/m``. The spring must pull back from the largest amplitude.
    """
    # Reversals of small half-cycles have the least accurate times.
    columns = np.stack([np.ones_like(decay.mean), 3 / 4 * decay.mean**2], axis=1) * decay.mean[:, None]
    square, share = np.linalg.lstsq(columns, decay.omega**2 * decay.mean, rcond=None)[0]
    square = max(square, float(np.min(decay.omega)) ** 2 / 2)
    return float(square), float(max(share, -0.9 * square / np.max(decay.mean) ** 2))


def _of_pendulum(
    oscillator: Oscillator,
    decays: Sequence[Segmentation],
    free: Sequence[str],
    at: Mapping[str, Any],
    lower: Mapping[str, float],
) -> dict[str, Any] | None:
    """Return the coefficients of a pendulum from its envelope, if possible."""
    friction = float(oscillator.friction.dynamic_force(oscillator.normal_force))
    values = {"friction": friction, "damping": at["damping"], "drag": at["drag"]}
    sought = {name: {name} & set(free) for name in values}
    sought["friction"] = {"mu", "normal_force"} & set(free)
    few = sum(decay.turning_points.size for decay in decays) < _TELLING
    least = {name: max(lower.get(name, -np.inf), 0.0 if few else -np.inf) for name in values} | {"friction": 0.0}
    mass, omega = at["mass"], np.sqrt(at["stiffness"] / at["mass"])
    known = {} if {"stiffness", "mass"} & set(free) else {"omega": omega}

    def seen(mass: float) -> Envelope | None:
        fixed = {name: value / mass for name, value in values.items() if not sought[name]}
        return envelope(decays, {**fixed, **known}, {name: value / mass for name, value in least.items()})

    estimate = seen(mass)
    if estimate is not None and "mass" in free and "stiffness" not in free:
        # With a known spring the inertia follows from the frequency; fixed damping and drag are then divided by it.
        mass = at["stiffness"] / estimate.omega**2
        estimate = seen(mass)
    if estimate is None:
        return None
    stiffness = at["stiffness"] if "stiffness" not in free else mass * estimate.omega**2
    force = max(estimate.friction, _LEAST_SHARE * estimate.loss) * estimate.omega**2 * mass
    parts = {"friction": force, "damping": estimate.damping * estimate.omega * mass, "drag": estimate.drag * mass}
    identified = {name: value for name, value in parts.items() if sought[name]}
    return {**at, "mass": mass, "stiffness": stiffness, **_as_coefficients(identified, sought, at)}


def _decay(segmentation: Segmentation) -> _Decay:
    times, points = extremes(segmentation)
    if points.size < 3:
        return _short(segmentation)
    amplitude = np.abs(points - equilibrium(segmentation))
    return _Decay(amplitude[:-1], amplitude[1:], np.pi / np.diff(times))


def _short(segmentation: Segmentation) -> _Decay:
    """Return one half-cycle for a record with fewer than three reversals.

    It has the whole excursion about the middle as its amplitude, and loses a tenth of it.
    """
    if segmentation.half_period <= 0:
        return _Decay(*np.zeros((3, 0)))
    amplitude = np.array([segmentation.amplitude])
    return _Decay(amplitude, 0.9 * amplitude, np.array([np.pi / segmentation.half_period]))


def _stiffening(oscillator: Oscillator, amplitude: np.ndarray, at: Mapping[str, float]) -> np.ndarray:
    """Return effective over small-amplitude stiffness, by harmonic balance.

    The integral over a cycle is a Chebyshev sum.
    """
    x = amplitude[:, None] * _QUADRATURE
    force = _at_positions(oscillator.restoring.force, x, at["stiffness"])
    effective = 2 * np.mean(force * _QUADRATURE, axis=1) / amplitude
    return np.clip(effective / at["stiffness"], 1e-3, 1e3)


def _at_positions(function: Callable[[Any, Any], Any], x: np.ndarray, stiffness: float) -> np.ndarray:
    """Evaluate a restoring force or potential at positions of any number.

    Padding limits the number of shapes that JAX compiles.
    """
    padded = np.zeros(2 ** max(11, (x.size - 1).bit_length()))
    padded[: x.size] = x.ravel()
    return np.asarray(function(padded, stiffness))[: x.size].reshape(x.shape)


def _losses(oscillator: Oscillator, decay: _Decay, free: Sequence[str], at: Mapping[str, float]) -> dict[str, float]:
    a = decay.mean
    ends = (_at_positions(oscillator.restoring.potential, x, at["stiffness"]) for x in (decay.before, decay.after))
    lost = np.subtract(*ends)
    terms = {
        "friction": 2 * a,
        "damping": np.pi / 2 * decay.omega * a**2,
        "drag": 4 / 3 * decay.omega**2 * a**3,
        "returned": -np.ones_like(a),
    }
    friction = float(oscillator.friction.dynamic_force(oscillator.normal_force))
    known = {"friction": friction, "damping": at["damping"], "drag": at["drag"], "returned": 0.0}
    sought = {name: {name} & set(free) for name in terms}
    sought["friction"] = {"mu", "normal_force"} & set(free)
    lost = lost - sum(known[name] * term for name, term in terms.items() if not sought[name])
    names = [name for name in terms if sought[name]]
    if a.size <= len(names):
        # With as many terms as half-cycles, a term this small cannot be determined.
        names = [name for name in names if name != "returned"]
    if not names:
        return {}
    columns = np.stack([terms[name] for name in names], axis=1)
    size = np.maximum(np.abs(columns).max(axis=0), 1e-300)
    solution = non_negative(columns / size, lost) / size
    floor = 1e-3 * max(float(np.mean(lost)), 0.0) / np.mean(columns, axis=0)
    losses = dict(zip(names, np.maximum(solution, floor), strict=True))
    return _as_coefficients(losses, sought, at)


def _as_coefficients(
    losses: Mapping[str, float], sought: Mapping[str, set], at: Mapping[str, float]
) -> dict[str, float]:
    result = {name: float(losses[name]) for name in ("damping", "drag", "returned") if name in losses}
    if "friction" in losses:
        force = float(losses["friction"])
        if "mu" in sought["friction"]:
            result["mu"] = force / at["normal_force"] if at["normal_force"] > 0 else at["mu"]
        else:
            result["normal_force"] = force / at["mu"] if at["mu"] > 0 else at["normal_force"]
    return result
