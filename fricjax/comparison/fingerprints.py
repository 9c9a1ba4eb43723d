"""Fingerprints of friction in a decay, before any law is fitted.

Between two turning points with amplitudes a and a' and mean amplitude A, the spring loses

    (a^2 - a'^2)/2 = x_d (a + a') + (pi/2) (c omega/k) A^2 - 2 x_d l,

where x_d is the dead band, c the damping and l the deflection of a contact that yields before it slides. At each
reversal the contact returns the stored energy (Dahl, 1968). Friction that falls with velocity increases the loss at
small amplitudes. In the regression this appears as less damping and as a positive last term. Therefore a regression of
the losses on these terms separates Coulomb friction, falling friction and presliding. A yielding contact also shows at
the end of the decay: the mass springs back from its last turning point.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import thresholds
from ..fitting.window import Window, equilibrium, without_ringing
from ..oscillator import Oscillator
from ..show import engineering, uncertain

# Assumed relative error of the calibrated damping without contact.
_TRUSTED = 0.05


class Losses(NamedTuple):
    """Regression of the half-cycle losses on dead band, damping and presliding.

    Attributes:
        dead_band: dead band x_d [m].
        damping: damping c [N s/m].
        returned: energy returned by each reversal over the stiffness, 2 x_d l [m^2].
        plain_damping: damping c [N s/m] of the regression without the last term (Coulomb friction and damping only).
        errors: standard errors of these four, from the noise of the turning points or, if larger, from the scatter.
    """

    dead_band: float
    damping: float
    returned: float
    plain_damping: float
    errors: tuple[float, float, float, float]

    @property
    def deflection(self) -> float:
        """Deflection l of the contact during sliding [m]."""
        return self.returned / (2 * self.dead_band)


def fingerprints(windows: Sequence[Window], oscillator: Oscillator) -> tuple[str, ...]:
    """Describe falling friction, presliding and spring-back of the runs.

    Args:
        windows: the runs.
        oscillator: the machine; its damping is the value without contact.

    Returns:
        A sentence or two for each effect that the runs show.
    """
    quantity = windows[0].motion
    backs = [spring_back(window) for window in windows]
    depths = [back for back in backs if back is not None]
    springs = bool(depths) and len(depths) == sum(window.segmentation.rest is not None for window in windows)
    losses, sentences = regress_losses(windows, oscillator), []
    if losses is not None:
        no_contact, stiffness = float(oscillator.damping), float(oscillator.stiffness)
        _, _, returned_std, std = losses.errors
        returns = losses.returned > thresholds.SURE * returned_std
        reduced = losses.plain_damping < min((1 - _TRUSTED) * no_contact, no_contact) - thresholds.SURE * std
        if losses.returned < -thresholds.SURE * returned_std or (reduced and not returns):
            less = "negative" if losses.plain_damping < 0 else f"against {no_contact:.4g} N s/m without contact"
            other = ", or the contact damps its own motion (LuGre with a large sigma1)" if springs else ""
            sentences.append(
                "Falling friction: the losses grow towards small amplitudes, so that Coulomb friction would ask for a "
                f"damping of {uncertain(losses.plain_damping, std, 'N s/m')}, {less}. Friction falls with velocity "
                f"(Stribeck){other}."
            )
        if returns:
            length = losses.deflection
            sentences.append(
                "Pre-sliding: each reversal gives back the same energy, as a contact does that bends by "
                f"{engineering(length, quantity)} before it slides (stiffness about "
                f"{losses.dead_band * stiffness / length:.2g} N/m; Dahl, LuGre)."
            )
    if springs:
        sentences.append(
            f"Spring-back: at rest the mass lies {engineering(min(depths), quantity)} or more back from its last "
            "turning point, so the contact yields before it slides (Dahl, LuGre) or creeps (Tanh)."
        )
    return tuple(sentences)


def regress_losses(windows: Sequence[Window], oscillator: Oscillator) -> Losses | None:
    """Regress the losses of all runs; None with too few half-cycles.

    Each run has a shift of its equilibrium as a further parameter.
    """
    runs = [run for run in (_HalfCycles.of(window, oscillator) for window in windows) if run is not None]
    if sum(run.lost.size for run in runs) < 3 + len(runs) + 1:
        return None
    blocks = []
    for i, run in enumerate(runs):
        total = run.before + run.after
        # The last columns are the effects of a shift of the equilibrium, one column per run.
        shifts = (run.sides * total)[:, None] * (np.arange(len(runs)) == i)
        columns = np.column_stack([total, np.pi / 8 * run.omega * total**2, -np.ones_like(total), shifts])
        # Losses of neighbouring half-cycles share a turning point; whiten them.
        root = np.linalg.inv(np.linalg.cholesky(run.covariance))
        blocks.append((root @ columns, root @ run.lost))
    matrix, lost = (np.concatenate(column) for column in zip(*blocks, strict=True))
    values, errors = _least_squares(matrix, lost)
    plain, plain_errors = _least_squares(np.delete(matrix, 2, axis=1), lost)
    k = float(oscillator.stiffness)
    return Losses(
        dead_band=float(values[0]),
        damping=k * float(values[1]),
        returned=float(values[2]),
        plain_damping=k * float(plain[1]),
        errors=(float(errors[0]), k * float(errors[1]), float(errors[2]), k * float(plain_errors[1])),
    )


def _least_squares(matrix: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solution and its standard errors, inf if it is undetermined."""
    size = np.linalg.norm(matrix, axis=0)
    solution, _, rank, _ = np.linalg.lstsq(matrix / size, lost, rcond=1e-10)
    if rank < size.size:
        return solution / size, np.full(size.size, np.inf)
    misfit = lost - matrix / size @ solution
    scatter = max(float(misfit @ misfit) / (lost.size - size.size), 1.0)
    inverse = np.linalg.inv((matrix / size).T @ (matrix / size))
    return solution / size, np.sqrt(scatter * np.diag(inverse)) / size


class _HalfCycles(NamedTuple):
    """Half-cycles of one run.

    Attributes:
        before, after: amplitudes at the start and the end of each half-cycle [m].
        sides: sign of the deflection at its start.
        omega: angular frequency [rad/s].
        lost: loss over the stiffness [m^2].
        covariance: covariance of the losses [m^4].
    """

    before: np.ndarray
    after: np.ndarray
    sides: np.ndarray
    omega: float
    lost: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of(cls, window: Window, oscillator: Oscillator) -> "_HalfCycles | None":
        segmentation = without_ringing(window.segmentation)
        points = segmentation.turning_points
        if points.size < 3:
            return None
        deflection: Any = points - equilibrium(segmentation)
        stiffness = oscillator.stiffness
        energy = np.asarray(oscillator.restoring.potential(deflection, stiffness))
        noise = float(np.median(window.sigma)) / window.gain * np.abs(deflection)
        variance = noise[:-1] ** 2 + noise[1:] ** 2
        shared = -(noise[1:-1] ** 2)
        return cls(
            before=np.abs(deflection[:-1]),
            after=np.abs(deflection[1:]),
            sides=np.sign(deflection[:-1]),
            omega=np.pi / segmentation.half_period,
            lost=(energy[:-1] - energy[1:]) / float(stiffness),
            covariance=np.diag(variance) + np.diag(shared, 1) + np.diag(shared, -1),
        )


def spring_back(window: Window) -> float | None:
    """Distance of the rest position from the last turning point [m].

    It is None if it is within the noise, or if the record is no displacement.
    """
    segmentation = without_ringing(window.segmentation)
    rest, half = segmentation.rest, segmentation.half_period
    if window.observation.kind != "displacement" or rest is None or not segmentation.turning_points.size:
        return None
    t, x = np.asarray(window.trace.t), np.asarray(window.trace.x)
    usable = np.asarray(window.trace.mask)
    near = usable & (np.abs(t - rest) < half / 4)
    later = usable & (t > rest + half / 2) & (t < rest + 2 * half)
    if near.sum() < 4 or later.sum() < 4:
        return None
    position = float(np.mean(x[later]))
    direction = np.sign(position - segmentation.turning_points[-1])
    back = float(np.max(direction * (x[near] - position)))
    least = thresholds.EXTREME * float(np.median(window.sigma)) + 2 * segmentation.resolution
    return back if back > least else None
