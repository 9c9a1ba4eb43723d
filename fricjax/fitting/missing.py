"""What a model lacks that does not describe its record, as the reversals tell it.

Over a half-cycle of mean amplitude A the spring loses, over the stiffness, what :mod:`fricjax.comparison.fingerprints`
lists, and to a drag of coefficient q besides ``(4/3)(q/m) A^3``. Summed up from the first reversal on, this says how
far the energy of each turning point has fallen, and, over the slope of that, how large its amplitude is. A term
without which the amplitudes lie off by as much as the residuals of the fit, and with which they do not, is what the
model lacks. The same holds for the times of the reversals, which a spring that stiffens or softens shifts by a sum of
A^2.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ..friction import Coulomb
from ..oscillator import Oscillator
from ..oscillator.restoring import Linear
from ..show import engineering
from .names import NUISANCES
from .problem import Problem
from .window import equilibrium, without_ringing

# Reversals from which a term can be told from chance; part of the residuals that it must take away, which is the one
# worth a sentence, and part of them that must show in the reversals.
_FEWEST, _HALVES, _SHOWN = 8, 0.5, 0.5


class Lacking(NamedTuple):
    """A term that the model lacks.

    Attributes:
        term: its name: "damping", "drag", "contact", "falling", "softening" or "stiffening".
        left: what it would leave of the residuals at the reversals [m or rad], rms.
    """

    term: str
    left: float


class _Decay(NamedTuple):
    """Reversals of a run: deflections and times, mean amplitude and angular frequency between them."""

    y: np.ndarray
    t: np.ndarray
    mean: np.ndarray
    omega: float


class _Sums(NamedTuple):
    """What is read at each reversal, times its weight a length [m]; the terms that are free; and those that are not.

    Of the latter a positive multiple is sought.
    """

    read: np.ndarray
    weight: np.ndarray
    free: tuple[np.ndarray, ...]
    lacking: tuple[tuple[str, np.ndarray], ...]


def lacking(problem: Problem, run: int, size: float) -> Lacking | None:
    """The term that would halve residuals of this size [m or rad] in a run; None where none would."""
    window, machine = problem.windows[run], problem.residual.oscillator
    segmentation = without_ringing(window.segmentation)
    later = segmentation.turning_times >= window.t_start - segmentation.half_period / 4
    y = (segmentation.turning_points - equilibrium(segmentation))[later]
    if y.size < _FEWEST:
        return None
    mean = (np.abs(y[1:]) + np.abs(y[:-1])) / 2
    decay = _Decay(y, segmentation.turning_times[later], mean, np.pi / segmentation.half_period)
    kinds = {parameter.kind for parameter in problem.parameters}
    gains = [gain for sums in (_energies(decay, machine, kinds), _times(decay, machine)) for gain in _gains(sums, size)]
    if not gains:
        return None
    _, left, term = max(gains)
    return Lacking(term, left)


def advice(problem: Problem, run: int, term: Lacking) -> str:
    """A sentence on a term that a run lacks, and on how it is fitted."""
    quantity = problem.windows[run].quantity
    names = [parameter.name for parameter in problem.parameters if "[" not in parameter.name]
    shared = [name for name in names if name.rsplit(".", 1)[-1] not in NUISANCES]
    what, how = _advice(term.term, shared, quantity)
    rest = engineering(term.left, quantity)
    return f"{what} would leave {rest} of these residuals at the reversals: fit with {how}."


def _advice(term: str, free: list[str], quantity: str) -> tuple[str, str]:
    """What is lacking, and how it is fitted."""
    if term == "damping":
        return "A viscous damping", f"free={[*free, 'damping']}"
    if term == "drag":
        return "A drag with the square of the speed", f"free={[*free, 'drag']}"
    if term == "contact":
        return "A contact that bends before it slides", "friction=Dahl(...) or friction=LuGre(...)"
    if term == "falling":
        return "Friction that falls with velocity", "friction=Stribeck(...)"
    if term == "softening" and quantity == "rad":
        return "The restoring force of a pendulum", "restoring=Pendulum()"
    spring = f"A spring that {term.removesuffix('ing')}s with deflection"
    return spring, f"restoring=Cubic(0.0) with free={[*free, 'k3']}"


def _energies(decay: _Decay, machine: Oscillator, kinds: set[str]) -> _Sums:
    """Losses of the half-cycles, summed up."""
    stiffness, mass = float(machine.stiffness), float(machine.mass)
    k = jnp.asarray(machine.stiffness)
    energy, slope = (
        np.asarray(law(jnp.asarray(decay.y), k)) / stiffness
        for law in (machine.restoring.potential, machine.restoring.force)
    )
    damping = np.pi / 2 * decay.omega / stiffness * decay.mean**2
    drag = 4 / 3 / mass * decay.mean**3
    terms = {"damping": damping, "drag": drag}
    fixed = sum(
        (float(getattr(machine, name)) * terms[name] for name in terms.keys() - kinds), np.zeros(decay.mean.size)
    )
    bend = -np.ones(decay.mean.size)
    always = [np.abs(decay.y[1:]) + np.abs(decay.y[:-1]), *(terms[name] for name in terms.keys() & kinds)]
    sought = {name: terms[name] for name in terms.keys() - kinds}
    # Other laws than that of constant friction have losses of their own, which this term may stand for.
    if _is_constant(machine):
        sought |= {"contact": bend, "falling": -bend}
    else:
        always.append(bend)
    free = (np.ones(decay.y.size), slope, *(_summed(term) for term in always))
    fallen = energy[0] - energy - _summed(fixed)
    return _Sums(fallen, 1 / np.abs(slope), free, tuple((name, _summed(term)) for name, term in sought.items()))


def _times(decay: _Decay, machine: Oscillator) -> _Sums:
    """Durations of the half-cycles, summed up."""
    ranks = np.arange(decay.t.size)
    free = np.ones(ranks.size), ranks * np.pi / decay.omega
    sought = []
    if isinstance(machine.restoring, Linear):
        square = _summed(decay.mean**2)
        sought += [("softening", square), ("stiffening", -square)]
    if _is_constant(machine):
        # From the reversal on the mass takes this long to bend the contact, whose force differs from that of sliding.
        bent = _summed(decay.mean**-0.5)
        sought += [("contact", bent), ("contact", -bent)]
    return _Sums(decay.t - decay.t[0], decay.omega * np.abs(decay.y), free, tuple(sought))


def _is_constant(machine: Oscillator) -> bool:
    law = machine.friction
    return not law.n_states and isinstance(law.set_valued_limit(), Coulomb)


def _summed(terms: np.ndarray) -> np.ndarray:
    return np.append(0.0, np.cumsum(terms))


def _gains(sums: _Sums, size: float) -> list[tuple[float, float, str]]:
    """Squares that each term takes away and the root of what it leaves, where its lack explains residuals of a size."""
    without, _ = _fitted(sums, ())
    if without < _SHOWN * size:
        return []
    fits = [(name, *_fitted(sums, (term,))) for name, term in sums.lacking]
    return [(without**2 - left**2, left, name) for name, left, value in fits if value > 0 and left < _HALVES * without]


def _fitted(sums: _Sums, more: tuple[np.ndarray, ...]) -> tuple[float, float]:
    """What is left of the readings, as the root mean square of a swing of that amplitude, and the last coefficient."""
    columns = np.stack([*sums.free, *more], axis=1) * sums.weight[:, None]
    unit = np.linalg.norm(columns, axis=0)
    solution = np.linalg.lstsq(columns / unit, sums.read * sums.weight, rcond=None)[0]
    off = sums.read * sums.weight - columns / unit @ solution
    return float(np.sqrt(off @ off / (off.size - unit.size) / 2)), float(solution[-1])
