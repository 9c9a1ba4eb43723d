"""A friction law fitted to a force map: weighted least squares, without any integration of the motion."""

import dataclasses
from collections.abc import Sequence
from html import escape
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from jaxtyping import Array, Float

from ..errors import UsageError
from ..estimation.levenberg_marquardt import LevenbergMarquardt
from ..estimation.status import CONVERGED, SENTENCES
from ..fitting.names import find_leaf
from ..friction import AbstractFriction
from ..oscillator import Oscillator, ready
from ..oscillator.leaves import Leaf, leaves_of
from ..show import Table, uncertain
from .force_map import ForceMap

MAX_STEPS = 200


@dataclasses.dataclass(frozen=True, eq=False)
class ForceFit:
    """A friction law fitted to a force map.

    Attributes:
        friction: the fitted law.
        values, std_errors, units: free coefficients by name, SI; the standard errors are those of the map's standard
            deviations, infinite where the map does not determine a coefficient.
        covariance: in the order of the names, shape (p, p).
        chi2, dof: sum of squared weighted residuals, and degrees of freedom.
        residuals: force of the map minus that of the law [N], shape (n,).
        converged: converged, and every coefficient determined.
        status: the outcome in words.
    """

    friction: AbstractFriction
    values: dict[str, float]
    std_errors: dict[str, float]
    units: dict[str, str]
    covariance: np.ndarray
    chi2: float
    dof: int
    residuals: np.ndarray
    converged: bool
    status: str

    @property
    def chi2_reduced(self) -> float:
        """Sum of squared weighted residuals per degree of freedom."""
        return self.chi2 / self.dof

    def table(self) -> Table:
        """One row per free coefficient."""
        rows = [[name, uncertain(self.values[name], self.std_errors[name], unit)] for name, unit in self.units.items()]
        return Table(["Coefficient", "Value"], rows, title=f"{_law(self.friction)} friction fitted to a force map")

    def summary(self) -> str:
        """The fit as plain text."""
        return f"{self.table().text()}\n\nreduced chi^2 {self.chi2_reduced:.3g}; {self.status}"

    def _repr_html_(self) -> str:
        return f"{self.table().html()}<p>reduced chi^2 {self.chi2_reduced:.3g}; {escape(self.status)}</p>"

    def to_dict(self) -> dict[str, Any]:
        """The fit as plain data, in SI units."""
        plain = ("values", "std_errors", "units", "chi2", "dof", "chi2_reduced", "converged", "status")
        arrays = {name: getattr(self, name).tolist() for name in ("covariance", "residuals")}
        return {"friction": _law(self.friction), **{name: getattr(self, name) for name in plain}, **arrays}


def fit_force_map(force_map: ForceMap, friction: AbstractFriction, free: Sequence[str] | None = None) -> ForceFit:
    """Fit a law without internal states to a force map.

    Args:
        force_map: what `friction_force_map` returned.
        friction: the law, whose coefficients are the start values.
        free: names of the coefficients to fit; None: all that the law has but an exponent.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: a law with internal states, unknown names, or more coefficients than the map has entries.
    """
    ready()
    leaves = _free(friction, force_map, free)
    start = np.array([float(jax.tree.leaves(friction)[leaf.index]) for leaf in leaves])
    logarithmic = np.array([leaf.coefficient.fitted_as == "logarithm" for leaf in leaves])
    data = [jnp.asarray(getattr(force_map, name)) for name in ("velocity", "force", "std")]
    indices = tuple(leaf.index for leaf in leaves)
    residual = _Residual(friction, indices, jnp.asarray(logarithmic), jnp.asarray(force_map.normal_force), *data)
    free_range = jnp.full(start.shape, jnp.inf)
    dof = force_map.force.size - start.size
    options = {"lower": -free_range, "upper": free_range, "dof": jnp.asarray(float(dof)), "floor": jnp.asarray(0.0)}
    solved = optx.least_squares(
        lambda y, args: args(y), LevenbergMarquardt(max_steps=MAX_STEPS), jnp.asarray(residual.coordinates(start)),
        args=residual, options=options, max_steps=MAX_STEPS, throw=False,
    )  # fmt: skip
    return _assembled(solved, residual, leaves, dof)


class _Residual(eqx.Module):
    """Force of the map minus that of the law, in standard deviations, against the free coefficients.

    Coefficients that must be positive are varied in their logarithm.
    """

    friction: AbstractFriction
    indices: tuple[int, ...] = eqx.field(static=True)
    logarithmic: Array
    load: Array
    velocity: Float[Array, " n"]
    force: Float[Array, " n"]
    std: Float[Array, " n"]

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """What the solver varies."""
        return np.where(self.logarithmic, np.log(np.where(self.logarithmic, values, 1.0)), values)

    def values(self, y: Float[Array, " p"]) -> Float[Array, " p"]:
        """The coefficients that coordinates stand for."""
        return jnp.where(self.logarithmic, jnp.exp(jnp.where(self.logarithmic, y, 0.0)), y)

    def law(self, y: Float[Array, " p"]) -> AbstractFriction:
        """The law with these coefficients."""
        leaves, structure = jax.tree.flatten(self.friction)
        for index, value in zip(self.indices, self.values(y), strict=True):
            leaves[index] = value
        return jax.tree.unflatten(structure, leaves)

    def __call__(self, y: Float[Array, " p"]) -> Float[Array, " n"]:
        computed = self.law(y).force(self.velocity, jnp.zeros(0), self.load)
        return (self.force - computed) / self.std


def _free(friction: AbstractFriction, force_map: ForceMap, names: Sequence[str] | None) -> list[Leaf]:
    """The leaves of the law to fit."""
    if not isinstance(friction, AbstractFriction):
        raise UsageError(f"friction must be a law such as fricjax.friction.Stribeck(...), got {friction!r}.")
    if friction.n_states:
        raise UsageError(
            f"{_law(friction)} friction has internal states, so that it is no function of velocity; fit its records "
            "with fricjax.fit."
        )
    oscillator = Oscillator(1.0, 1.0, 0.0, force_map.normal_force, friction)
    before = len(jax.tree.leaves((oscillator.mass, oscillator.stiffness, oscillator.damping, oscillator.normal_force)))
    owned = range(before, before + len(jax.tree.leaves(friction)))
    leaves = [leaf._replace(index=leaf.index - before) for leaf in leaves_of(oscillator) if leaf.index in owned]
    chosen = [leaf.name for leaf in leaves if not leaf.name.endswith("exponent")] if names is None else list(names)
    if not 0 < len(chosen) < force_map.force.size:
        raise UsageError(
            f"{len(chosen)} coefficients cannot be fitted to a map with {force_map.force.size} entries: free fewer, "
            "at least one, or take more bins."
        )
    return [find_leaf(name, leaves) for name in chosen]


def _assembled(solved: optx.Solution, residual: _Residual, leaves: list[Leaf], dof: int) -> ForceFit:
    """The solution in the terms of its user."""
    values, slope = np.asarray(residual.values(solved.value)), _slope(residual, solved.value)
    covariance = slope[:, None] * _inverse(np.asarray(solved.stats["normal"])) * slope
    status, names = int(solved.stats["status"]), [leaf.name for leaf in leaves]
    law = jax.tree.map(np.asarray, residual.law(solved.value))
    std = np.sqrt(np.diag(covariance))
    return ForceFit(
        friction=law,
        values=dict(zip(names, values.tolist(), strict=True)),
        std_errors=dict(zip(names, std.tolist(), strict=True)),
        units={leaf.name: leaf.unit for leaf in leaves},
        covariance=covariance,
        chi2=2 * float(solved.stats["cost"]),
        dof=dof,
        residuals=np.asarray(residual(solved.value) * residual.std),
        converged=status == CONVERGED and bool(np.all(np.isfinite(std))),
        status=SENTENCES[status],
    )


def _slope(residual: _Residual, y: Array) -> np.ndarray:
    """Derivative of each coefficient with respect to its coordinate."""
    return np.asarray(jnp.where(residual.logarithmic, residual.values(y), 1.0))


def _inverse(normal: np.ndarray) -> np.ndarray:
    """Inverse of the normal matrix; infinite variances where it is singular."""
    unit = np.sqrt(np.where(np.diag(normal) > 0, np.diag(normal), 1.0))
    scaled = normal / np.outer(unit, unit)
    if not np.all(np.isfinite(scaled)) or np.linalg.cond(scaled) > 1e13:
        return np.diag(np.full(unit.size, np.inf))
    return np.linalg.inv(scaled) / np.outer(unit, unit)


def _law(friction: AbstractFriction) -> str:
    return " + ".join(type(law).__name__ for law in getattr(friction, "laws", (friction,)))
