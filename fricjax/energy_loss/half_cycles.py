"""Friction from the energy loss in half-cycles, using only the reversal positions.

Between two reversals the potential energy falls by the work of friction and the viscous loss. For Coulomb and viscous
friction on a linear spring the viscous loss is known exactly. With alternating amplitudes a_n and the amplitude ratio
rho = exp(-pi zeta/sqrt(1 - zeta^2)), ``a_{n+1} = rho a_n - (1 + rho) F/k``, so that

    F_n = k (rho a_n - a_{n+1})/(1 + rho)

is the mean friction force of the half-cycle, and the rest of the energy loss is viscous.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..fitting.rig_inputs import contradiction
from ..oscillator import Oscillator, ready
from ..rig import Measured, Rig
from ..show import Cell, Report, Reported, Style, Table, axis_label, display_unit, figure, scaled, styled, uncertain
from ..show.thumbnail import Curve, curves_svg
from .decay import Decay, decay, each_of, frictionless, with_losses
from .force_map import weighted

# Iterations for the equilibrium. It enters linearly, except through a curved restoring force and quadratic drag.
ROUNDS = 4
# Step of the derivatives with respect to positions, relative to the span of the reversals.
STEP = 1e-4


@dataclasses.dataclass(frozen=True, eq=False)
class HalfCycleFriction(Reported):
    """Mean friction force of each half-cycle.

    The arrays have shape (n,) and join all records.

    Attributes:
        force: mean friction force over the path of the half-cycle [N].
        std: its standard uncertainty from the noise [N].
        swing: length of the path [m].
        record: index of its record among those used.
        mean: weighted mean of the forces [N]; its uncertainty follows from the noise or the scatter, whichever is
            larger.
        mu: coefficient of friction: mean over load, with the uncertainties of the rig to first order [1].
        chi2_reduced: scatter of the forces about their weighted means, relative to the noise. A value above one shows
            that friction changes with amplitude, for example through the velocity.
        offsets: equilibrium position in each record [m].
        notes: sentences about skipped records, and about a rig with a different period.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> friction = fj.half_cycle_friction(files.run, fj.Rig.from_toml(files.rig))
        >>> friction.force.shape, friction.record.max()
        ((12,), np.int64(0))
    """

    force: np.ndarray
    std: np.ndarray
    swing: np.ndarray
    record: np.ndarray
    mean: Measured
    mu: Measured
    chi2_reduced: float
    offsets: tuple[Measured, ...]
    notes: tuple[str, ...]

    def report(self) -> Report:
        """Report one row per half-cycle, and a summary."""
        cells = zip(*(of.tolist() for of in (self.record, self.swing, self.force, self.std)), strict=True)
        rows = [
            [i, Cell(1e3 * swing, swing=swing), Cell(Measured(force, std), force=force, force_std=std)]
            for i, swing, force, std in cells
        ]
        facts = [
            ("mean friction force", uncertain(self.mean.value, self.mean.std, "N")),
            ("coefficient of friction", uncertain(self.mu.value, self.mu.std)),
            ("scatter over noise", f"{self.chi2_reduced:.3g} (reduced chi^2)"),
            ("data", f"{self.force.size} half-cycles in {len(self.offsets)} records"),
        ]
        units = {"swing": "m", "force": "N", "force_std": "N"}
        table = Table(["Record", "Path [mm]", "Mean friction force [N]"], rows, units=units)
        return Report([table], facts, self.notes, heading="Half-cycles", data=vars(self))

    def thumbnails(self) -> Sequence[str]:
        return [curves_svg([Curve(self.swing, self.force, self.std)], ("Path", "m"), ("Mean friction force", "N"))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot the mean friction force of each half-cycle against its path.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure()
        swing, unit_x = scaled(self.swing, "m")
        factor, unit_f = display_unit(abs(self.mean.value), "N")
        for i in np.unique(self.record):
            on = self.record == i
            bars = {"linestyle": "none", "marker": "o", "markersize": 3.5, "label": f"record {i}"}
            axes[0, 0].errorbar(swing[on], factor * self.force[on], factor * self.std[on], **bars)
        axes[0, 0].axhline(factor * self.mean.value, color="0.3", linewidth=1.0, label="mean")
        axes[0, 0].set_xlabel(axis_label("Path", unit_x))
        axes[0, 0].set_ylabel(axis_label("Mean friction force", unit_f))
        drawing.legend(loc="outside upper center", ncols=3, fontsize=8)
        return styled(drawing, style)


def half_cycle_friction(records: Any, rig: Rig, no_contact: Any = None) -> HalfCycleFriction:
    """Measure the mean friction force of each half-cycle after the first reversal.

    The method uses only the positions at the reversals. The equilibrium of each record is fitted such that all its
    half-cycles have the same friction.

    Args:
        records: a run, or a list of runs of one machine, each as for :func:`fricjax.fit`.
        rig: restoring force, mass, load, and the damping and drag to subtract.
        no_contact: a run without contact; its damping and drag replace those of the rig.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or a rig without damping.
        DataError: records with too few half-cycles, or sampled unevenly.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> friction = fj.half_cycle_friction(files.run, fj.Rig.from_toml(files.rig))
        >>> round(friction.mu.value, 4)
        0.02
    """
    ready()
    rig = with_losses(rig, no_contact)
    oscillator = frictionless(rig)
    decays, notes = each_of(records, decay)
    balances = [_balance(each, oscillator) for each in decays]
    joint = weighted([each.mean for each in balances])
    dof = max(sum(each.force.size - 2 for each in balances) + len(balances) - 1, 1)
    chi2 = sum(each.chi2 + ((each.mean.value - joint.value) / each.mean.std) ** 2 for each in balances)
    reduced = float(chi2) / dof
    mean = Measured(joint.value, joint.std * max(reduced, 1.0) ** 0.5)
    # Shift each input of the rig by its standard uncertainty (JCGM 100, 5.1).
    load = float(rig.normal_force.value)
    mu, variance = mean.value / load, (mean.std / load) ** 2
    for other, scale in rig.shifted():
        stretched = (dataclasses.replace(d, points=scale * d.points, point_std=scale * d.point_std) for d in decays)
        force = weighted([_balance(each, frictionless(other)).mean for each in stretched]).value
        variance += (force / float(other.normal_force.value) - mu) ** 2
    force, std = (np.concatenate([getattr(each, name) for each in balances]) for name in ("force", "std"))
    return HalfCycleFriction(
        force=force,
        std=std,
        swing=np.concatenate([np.abs(np.diff(each.points)) for each in decays]),
        record=np.repeat(np.arange(len(decays)), [each.force.size for each in balances]),
        mean=mean,
        mu=Measured(mu, float(variance**0.5)),
        chi2_reduced=reduced,
        offsets=tuple(each.offset for each in balances),
        notes=(*notes, *contradiction(oscillator, float(np.median(np.diff(decays[0].times))))),
    )


class _Balance(NamedTuple):
    """Forces of one record, their mean, the equilibrium, and chi^2."""

    force: np.ndarray
    std: np.ndarray
    mean: Measured
    offset: Measured
    chi2: float


def _balance(decay: Decay, oscillator: Oscillator) -> _Balance:
    """Fit friction force and equilibrium of a record by generalised least squares."""
    points, step = decay.points, STEP * float(np.ptp(decay.points))
    offset = float(np.mean([points[:-1].mean(), points[1:].mean()]))
    for _ in range(ROUNDS):
        offset += _solve(points - offset, decay.point_std, oscillator, step)[0][1]
    (mean, _), inverse, chi2 = _solve(points - offset, decay.point_std, oscillator, step)
    deviation = np.sqrt(np.diag(inverse))
    return _Balance(
        force=_forces(points - offset, oscillator),
        std=np.sqrt(np.diag(_covariance(points - offset, decay.point_std, oscillator, step))),
        mean=Measured(mean, deviation[0]),
        offset=Measured(offset, deviation[1]),
        chi2=chi2,
    )


def _solve(y: np.ndarray, std: np.ndarray, oscillator: Oscillator, step: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return mean force [N] and shift of the equilibrium [m], covariance, chi^2.

    The forces of neighbouring half-cycles are correlated, because they share a reversal.
    """
    force = _forces(y, oscillator)
    slope = (_forces(y + step, oscillator) - _forces(y - step, oscillator)) / (2 * step)
    covariance = _covariance(y, std, oscillator, step)
    basis = np.column_stack([np.ones_like(force), slope])
    weights = np.linalg.solve(covariance, basis)
    inverse = np.linalg.inv(basis.T @ weights)
    solution = inverse @ (weights.T @ force)
    residual = force - basis @ solution
    return solution, inverse, float(residual @ np.linalg.solve(covariance, residual))


def _forces(y: np.ndarray, oscillator: Oscillator) -> np.ndarray:
    """Return the mean friction force of each half-cycle [N].

    The reversals are at `y` from the equilibrium.
    """
    omega, zeta = float(oscillator.angular_frequency), float(oscillator.damping_ratio)
    rho, stiffness = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), float(oscillator.stiffness)
    sign = np.sign(y[:-1] - y[1:])
    before, after = sign * y[:-1], -sign * y[1:]
    potential = np.asarray(oscillator.restoring.potential(y, oscillator.stiffness))  # pyright: ignore[reportArgumentType]
    elastic = -np.diff(potential) / (before + after)
    # For a linear spring: energy loss over path, minus the friction force.
    viscous = stiffness * ((before - after) / 2 - (rho * before - after) / (1 + rho))
    # Quadratic drag along a harmonic half-cycle, over its path.
    drag = float(oscillator.drag) * (2 / 3) * omega**2 * ((before + after) / 2) ** 2
    return elastic - viscous - drag


def _covariance(y: np.ndarray, std: np.ndarray, oscillator: Oscillator, step: float) -> np.ndarray:
    """Return the covariance of the forces from the reversals, shape (n, n)."""
    moved = [_forces(y + step * unit, oscillator) - _forces(y - step * unit, oscillator) for unit in np.eye(y.size)]
    slopes = np.array(moved).T / (2 * step) * std
    return slopes @ slopes.T
