"""What a decay says of friction before any law is fitted to it.

Between two turning points with amplitudes a and a', of mean A, the spring loses

    (a^2 - a'^2)/2 = x_d (a + a') + (pi/2) (c omega/k) A^2 - 2 x_d l,

where x_d is the dead band, c the damping and l the deflection of a contact that yields before it slides: at each
reversal the contact gives back what it stored (Dahl, 1968). Friction that falls with velocity works against this as
more loss at small amplitudes, hence as less damping and as a gain in place of the last term. So a regression of the
losses on these terms tells Coulomb friction, falling friction and pre-sliding apart. A contact that yields shows once
more at the end: the mass does not stay at its last turning point but springs back.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..fitting.window import Window, equilibrium, without_ringing
from ..oscillator import Oscillator
from ..show import engineering, uncertain

_SURE = 4.0
_TRUSTED = 0.05
_NOISE = 6.0


class Losses(NamedTuple):
    """The regression of the half-cycle losses on dead band, damping and pre-sliding.

    Attributes:
        dead_band: x_d [m]; `damping`: c [N s/m]; `returned`: 2 x_d l, what each reversal gives back over the stiffness
            [m^2].
        plain_damping: c [N s/m] of the regression without the last term: that of Coulomb friction and damping alone.
        errors: standard errors of these four, by the noise of the turning points or by the scatter where it is larger.
    """

    dead_band: float
    damping: float
    returned: float
    plain_damping: float
    errors: tuple[float, float, float, float]

    @property
    def deflection(self) -> float:
        """Deflection l of the contact in full sliding [m]."""
        return self.returned / (2 * self.dead_band)


def fingerprints(windows: Sequence[Window], oscillator: Oscillator) -> tuple[str, ...]:
    """Sentences about falling friction, pre-sliding and spring-back, as far as the runs show them.

    Args:
        windows: the runs.
        oscillator: the machine; its damping counts as the value without contact.
    """
    quantity = windows[0].quantity
    backs = [spring_back(window) for window in windows]
    returns = [back for back in backs if back is not None]
    springs = bool(returns) and len(returns) == sum(window.segmentation.rest is not None for window in windows)
    losses = regressed(windows, oscillator)
    found = [] if losses is None else _of_losses(losses, oscillator, quantity, springs)
    if springs:
        found.append(
            f"Spring-back: at rest the mass lies {engineering(min(returns), quantity)} or more back from its last "
            "turning point, so the contact yields before it slides (Dahl, LuGre) or creeps (Tanh)."
        )
    return tuple(found)


def _of_losses(losses: Losses, oscillator: Oscillator, quantity: str, springs: bool) -> list[str]:
    no_contact, stiffness = float(oscillator.damping), float(oscillator.stiffness)
    _, _, returned_std, std = losses.errors
    found = []
    returns = losses.returned > _SURE * returned_std
    reduced = losses.plain_damping < min((1 - _TRUSTED) * no_contact, no_contact) - _SURE * std
    if losses.returned < -_SURE * returned_std or (reduced and not returns):
        less = "negative" if losses.plain_damping < 0 else f"against {no_contact:.4g} N s/m without contact"
        other = ", or the contact damps its own motion (LuGre with a large sigma1)" if springs else ""
        found.append(
            "Falling friction: the losses grow towards small amplitudes, so that Coulomb friction would ask for a "
            f"damping of {uncertain(losses.plain_damping, std, 'N s/m')}, {less}. Friction falls with velocity "
            f"(Stribeck){other}."
        )
    if returns:
        length = losses.deflection
        found.append(
            f"Pre-sliding: each reversal gives back the same energy, as a contact does that bends by "
            f"{engineering(length, quantity)} before it slides (stiffness about "
            f"{losses.dead_band * stiffness / length:.2g} N/m; Dahl, LuGre)."
        )
    return found


def regressed(windows: Sequence[Window], oscillator: Oscillator) -> Losses | None:
    """The regression over all runs, each with the shift of its equilibrium; None with too few half-cycles."""
    parts = [part for part in (_Strokes.of(window, oscillator) for window in windows) if part is not None]
    if sum(part.lost.size for part in parts) < 3 + len(parts) + 1:
        return None
    blocks = [_equations(part, np.arange(len(parts)) == i) for i, part in enumerate(parts)]
    matrix, lost = (np.concatenate(column) for column in zip(*blocks, strict=True))
    values, errors = _least_squares(matrix, lost)
    plain, plain_errors = _least_squares(np.delete(matrix, 2, axis=1), lost)
    k = float(oscillator.stiffness)
    told = float(values[0]), k * float(values[1]), float(values[2]), k * float(plain[1])
    spread = float(errors[0]), k * float(errors[1]), float(errors[2]), k * float(plain_errors[1])
    return Losses(*told, spread)


def _equations(part: "_Strokes", own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The terms of each half-cycle of a run and its loss, made independent and of unit variance.

    The last columns are what a shift of the equilibrium of each run changes, in the run that `own` marks.
    """
    sum_ = part.before + part.after
    shift = (part.sides * sum_)[:, None] * own
    columns = np.column_stack([sum_, np.pi / 8 * part.omega * sum_**2, -np.ones_like(sum_), shift])
    root = np.linalg.inv(np.linalg.cholesky(part.covariance))
    return root @ columns, root @ part.lost


def _least_squares(matrix: np.ndarray, lost: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solution and its standard errors, inf where the half-cycles do not determine it."""
    size = np.linalg.norm(matrix, axis=0)
    solution, _, rank, _ = np.linalg.lstsq(matrix / size, lost, rcond=1e-10)
    if rank < size.size:
        return solution / size, np.full(size.size, np.inf)
    misfit = lost - matrix / size @ solution
    scatter = max(float(misfit @ misfit) / (lost.size - size.size), 1.0)
    inverse = np.linalg.inv((matrix / size).T @ (matrix / size))
    return solution / size, np.sqrt(scatter * np.diag(inverse)) / size


class _Strokes(NamedTuple):
    """Half-cycles of one run.

    Amplitudes before and after each [m], the side of the first, the angular frequency [rad/s], the loss over the
    stiffness [m^2] and its covariance.
    """

    before: np.ndarray
    after: np.ndarray
    sides: np.ndarray
    omega: float
    lost: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of(cls, window: Window, oscillator: Oscillator) -> "_Strokes | None":
        found = without_ringing(window.segmentation)
        points = found.turning_points
        if points.size < 3:
            return None
        deflection: Any = points - equilibrium(found)
        stiffness = oscillator.stiffness
        energy = np.asarray(oscillator.restoring.potential(deflection, stiffness))
        noise = float(np.median(window.sigma)) * np.abs(deflection)
        variance = noise[:-1] ** 2 + noise[1:] ** 2
        shared = -(noise[1:-1] ** 2)
        return cls(
            before=np.abs(deflection[:-1]),
            after=np.abs(deflection[1:]),
            sides=np.sign(deflection[:-1]),
            omega=np.pi / found.half_period,
            lost=(energy[:-1] - energy[1:]) / float(stiffness),
            covariance=np.diag(variance) + np.diag(shared, 1) + np.diag(shared, -1),
        )


def spring_back(window: Window) -> float | None:
    """How far the mass lies back from its last turning point at rest [m]; None where that is within the noise."""
    found = without_ringing(window.segmentation)
    if found.rest is None or not found.turning_points.size:
        return None
    t, x = np.asarray(window.trace.t), np.asarray(window.trace.x)
    usable = np.asarray(window.trace.mask)
    near = usable & (np.abs(t - found.rest) < found.half_period / 4)
    later = usable & (t > found.rest + found.half_period / 2) & (t < found.rest + 2 * found.half_period)
    if near.sum() < 4 or later.sum() < 4:
        return None
    position = float(np.mean(x[later]))
    direction = np.sign(position - found.turning_points[-1])
    back = float(np.max(direction * (x[near] - position)))
    least = _NOISE * float(np.median(window.sigma)) + 2 * found.resolution
    return back if back > least else None
