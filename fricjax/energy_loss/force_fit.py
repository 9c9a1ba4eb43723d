"""Weighted least-squares fit of a friction law to a force map."""

import dataclasses
from collections.abc import Sequence
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
from ..friction.base import law_name
from ..oscillator import Oscillator, ready
from ..oscillator.oscillator import Leaf, leaves_of
from ..pairs.result import coefficient_table
from ..show import Report, Reported, Style, figure, styled
from .force_map import ForceMap

# Far more steps than a fit needs from a start value of the right order.
MAX_STEPS = 200
# Condition of the scaled normal matrix above which a coefficient counts as undetermined, because only rounding remains.
SINGULAR = 1e13


@dataclasses.dataclass(frozen=True, eq=False)
class ForceFit(Reported):
    """A friction law fitted to a force map.

    Attributes:
        friction: the fitted law.
        values, std_errors, units: free coefficients by name, SI; the standard errors follow from the standard
            deviations of the map and are infinite for undetermined coefficients.
        covariance: covariance matrix in the order of the names, shape (p, p).
        chi2, dof: sum of squared weighted residuals, and degrees of freedom.
        residuals: force of the map minus that of the law [N], shape (n,).
        force_map: the fitted map.
        converged: True if the fit converged and determines every coefficient.
        status: the outcome in words.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> force_map = fj.friction_force_map(files.run, fj.Rig.from_toml(files.rig))
        >>> fit = fj.fit_force_map(force_map, fj.friction.Coulomb(0.05), ["mu"])
        >>> fit.friction.__class__.__name__, list(fit.units), fit.dof == force_map.force.size - 1
        ('Coulomb', ['mu'], True)
    """

    friction: AbstractFriction
    values: dict[str, float]
    std_errors: dict[str, float]
    units: dict[str, str]
    covariance: np.ndarray
    chi2: float
    dof: int
    residuals: np.ndarray
    force_map: ForceMap
    converged: bool
    status: str

    @property
    def chi2_reduced(self) -> float:
        """Sum of squared weighted residuals per degree of freedom."""
        return self.chi2 / self.dof

    def report(self) -> Report:
        """Report one row per coefficient, with law, status and scatter."""
        law = law_name(self.friction)
        facts = [
            ("law", f"{law} friction, fitted to a force map"),
            ("status", self.status),
            ("reduced chi^2", f"{self.chi2_reduced:.3g}"),
        ]
        table = coefficient_table(self.values, self.std_errors, self.units)
        data = vars(self) | {"friction": law, "chi2_reduced": self.chi2_reduced}
        del data["force_map"]
        return Report([table], facts, heading="Fit", data=data)

    def thumbnails(self) -> Sequence[str]:
        return self.force_map.thumbnails()

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the map with the fitted law, and the residuals below.

        The residuals are in standard deviations.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure(2, 1, share_x=True, heights=(5, 2))
        top, bottom = axes[:, 0]
        factor_v, factor_f = self.force_map.draw(top)
        speeds = np.abs(self.force_map.velocity)
        v = np.geomspace(speeds.min(), speeds.max(), 200)
        force = np.asarray(self.friction.force(jnp.asarray(v), jnp.zeros(0), jnp.asarray(self.force_map.normal_force)))
        top.plot(factor_v * v, factor_f * force, color="#000000", label=law_name(self.friction), zorder=3)
        bottom.set_xlabel(top.get_xlabel())
        top.set_xlabel("")
        bottom.axhspan(-2, 2, color="0.9", zorder=0)
        along = self.residuals * self.force_map.direction / self.force_map.std
        bottom.plot(factor_v * speeds, along, "o", markersize=3, color="#000000")
        bottom.set_ylabel("Residual [std]")
        drawing.align_ylabels()
        drawing.legend(loc="outside upper center", ncols=2, fontsize=8)
        return styled(drawing, style)


def fit_force_map(force_map: ForceMap, friction: AbstractFriction, free: Sequence[str] | None = None) -> ForceFit:
    """Fit a law without internal states to a force map.

    Args:
        force_map: a map from `friction_force_map`.
        friction: the law; its coefficients are the start values.
        free: names of the coefficients to fit; None: all coefficients of the law except exponents.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: a law with internal states, unknown names, or more coefficients than the map has entries.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> force_map = fj.friction_force_map(files.run, fj.Rig.from_toml(files.rig))
        >>> fit = fj.fit_force_map(force_map, fj.friction.Coulomb(0.05), ["mu"])
        >>> fit.converged, round(fit.values["mu"], 3)
        (True, 0.02)
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
    values = np.asarray(residual.values(solved.value))
    slope = np.asarray(jnp.where(residual.logarithmic, residual.values(solved.value), 1.0))
    covariance = slope[:, None] * _inverse(np.asarray(solved.stats["normal"])) * slope
    status, names, std = int(solved.stats["status"]), [leaf.name for leaf in leaves], np.sqrt(np.diag(covariance))
    return ForceFit(
        friction=jax.tree.map(np.asarray, residual.law(solved.value)),
        values=dict(zip(names, values.tolist(), strict=True)),
        std_errors=dict(zip(names, std.tolist(), strict=True)),
        units={leaf.name: leaf.unit for leaf in leaves},
        covariance=covariance,
        chi2=2 * float(solved.stats["cost"]),
        dof=dof,
        residuals=np.asarray(residual(solved.value) * residual.std),
        force_map=force_map,
        converged=status == CONVERGED and bool(np.all(np.isfinite(std))),
        status=SENTENCES[status],
    )


class _Residual(eqx.Module):
    """Weighted residuals of the force map as a function of the coefficients.

    They are force of the map minus force of the law, in standard deviations. Positive coefficients vary in their
    logarithm.
    """

    friction: AbstractFriction
    indices: tuple[int, ...] = eqx.field(static=True)
    logarithmic: Array
    load: Array
    velocity: Float[Array, " n"]
    force: Float[Array, " n"]
    std: Float[Array, " n"]

    def coordinates(self, values: np.ndarray) -> np.ndarray:
        """Return the solver's coordinates of the coefficients."""
        return np.where(self.logarithmic, np.log(np.where(self.logarithmic, values, 1.0)), values)

    def values(self, y: Float[Array, " p"]) -> Float[Array, " p"]:
        """Return the coefficients at coordinates."""
        return jnp.where(self.logarithmic, jnp.exp(jnp.where(self.logarithmic, y, 0.0)), y)

    def law(self, y: Float[Array, " p"]) -> AbstractFriction:
        """Return the law with the coefficients at coordinates."""
        leaves, structure = jax.tree.flatten(self.friction)
        for index, value in zip(self.indices, self.values(y), strict=True):
            leaves[index] = value
        return jax.tree.unflatten(structure, leaves)

    def __call__(self, y: Float[Array, " p"]) -> Float[Array, " n"]:
        computed = self.law(y).force(self.velocity, jnp.zeros(0), self.load)
        return (self.force - computed) / self.std


def _free(friction: AbstractFriction, force_map: ForceMap, names: Sequence[str] | None) -> list[Leaf]:
    """Select the coefficients of the law to fit."""
    if not isinstance(friction, AbstractFriction):
        raise UsageError(f"friction must be a law such as fricjax.friction.Stribeck(...), got {friction!r}.")
    if friction.n_states:
        raise UsageError(
            f"{law_name(friction)} friction has internal states, so that it is no function of velocity; fit its "
            "records with fricjax.fit."
        )
    # The names of coefficients are those in an oscillator, where other coefficients precede those of the law.
    oscillator = Oscillator(1.0, 1.0, 0.0, force_map.normal_force, friction)
    before = len(jax.tree.leaves((oscillator.mass, oscillator.stiffness, oscillator.damping, oscillator.normal_force)))
    of_law = range(before, before + len(jax.tree.leaves(friction)))
    leaves = [leaf._replace(index=leaf.index - before) for leaf in leaves_of(oscillator) if leaf.index in of_law]
    chosen = [leaf.name for leaf in leaves if not leaf.name.endswith("exponent")] if names is None else list(names)
    if not 0 < len(chosen) < force_map.force.size:
        raise UsageError(
            f"{len(chosen)} coefficients cannot be fitted to a map with {force_map.force.size} entries: free fewer, "
            "at least one, or take more bins."
        )
    return [find_leaf(name, leaves) for name in chosen]


def _inverse(normal: np.ndarray) -> np.ndarray:
    """Invert the normal matrix; return infinite variances if it is singular."""
    unit = np.sqrt(np.where(np.diag(normal) > 0, np.diag(normal), 1.0))
    scaled = normal / np.outer(unit, unit)
    if not np.all(np.isfinite(scaled)) or np.linalg.cond(scaled) > SINGULAR:
        return np.diag(np.full(unit.size, np.inf))
    return np.linalg.inv(scaled) / np.outer(unit, unit)
