"""Sentences on a planned run: what it cannot tell and why, and how another run would tell more."""

import itertools
from collections.abc import Iterator
from typing import TYPE_CHECKING

import jax.numpy as jnp
import numpy as np

from ..fitting.derived import Estimate
from ..fitting.names import NUISANCES
from ..show import duration, engineering
from .plan import TAIL
from .ridge import WORK, ridges_of

if TYPE_CHECKING:
    from .information import Information

FEWEST = 2
"""Half-cycles from which a run tells friction from the offset."""
BANDS = (6.0, 10.0)
"""Initial displacements in dead bands that are worth aiming at."""

# Correlations worth a word, those of friction and damping from where a prior on one pays.
_STRONG, _LOOKS_ALIKE = 0.95, 0.85
_WEAK, _EDGE, _SAMPLES = 0.3, 0.05, 20
_FALLING = ("v_stribeck", "exponent")


def errors(found: "Information") -> tuple[str, ...]:
    """What keeps a fit from being valid, with the remedy: parameters without effect and undetermined directions."""
    return (*(_idle(found, name) for name in found.idle), *(f"{d.text}. Fix one of them." for d in found.singular))


def _idle(found: "Information", name: str) -> str:
    kind = name.rsplit(".", 1)[-1]
    if found.course.half_cycles == 0:
        return f"{name} has no effect, for the mass does not move. Release it from farther away."
    if kind == "mu_s":
        return (
            f"{name} acts through the number of half-cycles alone, so that a trace has no gradient with respect to it: "
            "it is bracketed from stops and non-stops. Take it out of the free coefficients."
        )
    if kind in _FALLING:
        return f"{name} has no effect while mu_s equals mu: give the law a mu_s above mu, or take {name} out."
    return f"{name} has no effect on this run. Take it out of the free coefficients."


def remarks(found: "Information") -> tuple[str, ...]:
    """Advice on the run."""
    law = found.oscillator.friction
    parts = (_release(found), _edge(found), _record(found), _ridge(found), _alike(found), _weak(found))
    return (*itertools.chain(*parts), *law.warnings(float(found.oscillator.normal_force)))


def _release(found: "Information") -> Iterator[str]:
    """On the number of half-cycles that the release gives."""
    count, band = found.course.half_cycles, float(found.oscillator.dead_band)
    if count is None:
        return
    aim = f"Release from {engineering(BANDS[0] * band, 'm')} to {engineering(BANDS[1] * band, 'm')}"
    aim += f", {BANDS[0]:g} to {BANDS[1]:g} dead bands, or lower the normal force."
    if count == 0:
        yield f"The mass does not move from {engineering(found.x0, 'm')}: static friction holds it. {aim}"
    elif count < FEWEST:
        yield (
            f"The run has {count} half-cycle, and from fewer than {FEWEST} friction cannot be told from the offset: "
            f"only the centre of the stroke is seen. {aim}"
        )
    elif abs(found.x0) < BANDS[0] * band:
        yield f"The release is only {abs(found.x0) / band:.2g} dead bands away ({count} half-cycles). {aim}"


def _edge(found: "Information") -> Iterator[str]:
    """On a stop so close to another number of half-cycles that the run may have that one."""
    course, machine = found.course, found.oscillator
    if course.like_coulomb or not course.half_cycles:
        return
    held = float(machine.friction.static_force(machine.normal_force) / machine.stiffness)
    pull = np.abs(np.asarray(machine.restoring_force(jnp.asarray(course.turning_points)))) / float(machine.stiffness)
    margin, band = min(held - pull[-1], pull[-2] - held), float(machine.dead_band)
    if margin < _EDGE * band:
        other = course.half_cycles + (1 if held - pull[-1] == margin else -1)
        yield (
            f"The mass may also stop after {other} half-cycles: {engineering(margin, 'm')}, {margin / band:.1%} of the "
            "dead band, decide. Move the release by about one dead band."
        )


def _record(found: "Information") -> Iterator[str]:
    """On duration and rate."""
    stop, half = found.course.t_stop, np.pi / float(found.oscillator.angular_frequency)
    if np.isfinite(stop) and found.duration < stop:
        about = "about " if found.course.like_coulomb else ""
        yield (
            f"The record ends before the mass stops, {about}{duration(stop)} after the release. Record "
            f"{duration(stop + TAIL)}."
        )
    if found.rate * half < _SAMPLES:
        least = f"{_SAMPLES / half:.3g}"
        yield f"There are only {found.rate * half:.3g} samples in a half-cycle. Take {least} a second or more."


def _ridge(found: "Information") -> Iterator[str]:
    """On static coefficients and Stribeck velocities that are determined only together."""
    for ridge in ridges_of(found):
        related, best = found.correlation_of(ridge.mu_s, ridge.v_stribeck), ridge.best_power(found)
        if related > -_STRONG or not np.isfinite(ridge.estimate(found, best).std):
            continue
        told = [f"{ridge.text(p)} to {_relative(ridge.estimate(found, p)):.2g}" for p in (best, WORK)]
        alone = found.std_errors[ridge.v_stribeck] / ridge.speed
        seen = f"correlate by {related:.4f}" if np.isfinite(related) else "cannot be told apart"
        yield (
            f"{ridge.mu_s} and {ridge.v_stribeck} {seen}: the run tells {told[0]} of its value, but {told[1]} and "
            f"{ridge.v_stribeck} to {alone:.2g}. Fix one of the two."
        )


def _relative(estimate: Estimate) -> float:
    return estimate.std / abs(estimate.value)


def _alike(found: "Information") -> Iterator[str]:
    """On coefficients that act almost alike."""
    ridge = [{each.mu_s, each.v_stribeck} for each in ridges_of(found)]
    machine = [name for name in found.names if name not in NUISANCES]
    for first, second in itertools.combinations(machine, 2):
        related = found.correlation_of(first, second)
        decay = {"damping", "mu"} == {name.rsplit(".", 1)[-1] for name in (first, second)}
        if not abs(related) >= (_LOOKS_ALIKE if decay else _STRONG) or {first, second} in ridge:
            continue
        text = f"{first} and {second} correlate by {related:.3f}"
        if decay:
            text += ": the linear decay of friction and the exponential one of damping look much alike in this run"
            yield f"{text}. A prior on damping from a ring-down without contact helps."
        else:
            yield f"{text}. An independent value of one makes the other far better known."


def _weak(found: "Information") -> Iterator[str]:
    """On coefficients that the run tells hardly at all."""
    for name in found.names:
        share = found.std_errors[name] / abs(found.values[name]) if found.values[name] else 0.0
        if name not in NUISANCES and _WEAK < share < np.inf:
            yield f"{name} is hardly determined: its expected standard error is {share:.2g} of its value."
