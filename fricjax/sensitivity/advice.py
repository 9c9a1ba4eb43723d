"""Advice on a planned run: undetermined parameters, and a better run."""

import itertools
from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np

from ..fitting.names import NUISANCES
from ..show import duration, engineering
from .information import Information
from .plan import TAIL
from .ridge import WORK, ridges_of

# Fewest half-cycles that determine both friction and offset. One half-cycle determines only its centre.
_FEWEST = 2
# Recommended displacements at release, in dead bands.
_LEAST_BANDS, _MOST_BANDS = 6.0, 10.0
# Correlations to report; the second one is for friction and damping, and suggests a prior.
_STRONG, _LOOKS_ALIKE = 0.95, 0.85
# Standard error over value of a poorly determined coefficient.
_WEAK = 0.3
# Least distance from another number of half-cycles, as a fraction of the dead band.
_EDGE = 0.05
# Least number of samples per half-cycle.
_SAMPLES = 20


def errors_of(information: Information) -> Iterator[str]:
    """Yield parameters without effect and undetermined directions, with a remedy."""
    for name in information.no_effect:
        kind = name.rsplit(".", 1)[-1]
        if information.motion.half_cycles == 0:
            yield f"{name} has no effect, for the mass does not move. Release it from farther away."
        elif kind == "mu_s":
            yield (
                f"{name} acts through the number of half-cycles alone, so that a trace has no gradient with respect to "
                "it: it is bracketed from stops and non-stops. Take it out of the free coefficients."
            )
        elif kind in ("v_stribeck", "exponent"):
            yield f"{name} has no effect while mu_s equals mu: give the law a mu_s above mu, or take {name} out."
        else:
            yield f"{name} has no effect on this run. Take it out of the free coefficients."
    yield from (f"{direction.text}. Fix one of them." for direction in information.singular)


def warnings_of(information: Information) -> Iterator[str]:
    """Yield advice on the run."""
    yield from _on_the_stop(information)
    yield from _on_the_record(information)
    yield from _on_ridges(information)
    yield from _on_coefficients(information)
    yield from information.oscillator.friction.warnings(float(information.oscillator.normal_force))


def _on_the_stop(information: Information) -> Iterator[str]:
    """Yield advice on the number of half-cycles and an ambiguous stop."""
    motion, machine, x0 = information.motion, information.oscillator, information.x0
    count, band = motion.half_cycles, float(machine.dead_band)
    if count is None:
        return
    aim = f"Release from {engineering(_LEAST_BANDS * band, 'm')} to {engineering(_MOST_BANDS * band, 'm')}"
    aim += f", {_LEAST_BANDS:g} to {_MOST_BANDS:g} dead bands, or lower the normal force."
    if count == 0:
        yield f"The mass does not move from {engineering(x0, 'm')}: static friction holds it. {aim}"
    elif count < _FEWEST:
        yield (
            f"The run has {count} half-cycle, and from fewer than {_FEWEST} friction cannot be distinguished from the "
            f"offset: only the centre of the half-cycle is seen. {aim}"
        )
    elif abs(x0) < _LEAST_BANDS * band:
        yield f"The release is only {abs(x0) / band:.2g} dead bands away ({count} half-cycles). {aim}"
    if motion.like_coulomb or count == 0:
        return
    # Stretch of the spring under the static force, and at the last reversals.
    static = float(machine.friction.static_force(machine.normal_force) / machine.stiffness)
    pull = np.abs(np.asarray(machine.restoring_force(jnp.asarray(motion.turning_points)))) / float(machine.stiffness)
    margin = min(static - pull[-1], pull[-2] - static)
    if margin < _EDGE * band:
        other = count + (1 if static - pull[-1] == margin else -1)
        yield (
            f"The mass may also stop after {other} half-cycles: {engineering(margin, 'm')}, {margin / band:.1%} of the "
            "dead band, decide. Move the release by about one dead band."
        )


def _on_the_record(information: Information) -> Iterator[str]:
    """Yield advice on duration and rate."""
    stop, half = information.motion.t_stop, np.pi / float(information.oscillator.angular_frequency)
    if np.isfinite(stop) and information.duration < stop:
        about = "about " if information.motion.like_coulomb else ""
        yield (
            f"The record ends before the mass stops, {about}{duration(stop)} after the release. Record "
            f"{duration(stop + TAIL)}."
        )
    if information.rate * half < _SAMPLES:
        least = f"{_SAMPLES / half:.3g}"
        yield f"There are only {information.rate * half:.3g} samples in a half-cycle. Take {least} a second or more."


def _on_ridges(information: Information) -> Iterator[str]:
    """Yield advice on correlated static coefficients and Stribeck velocities."""
    for ridge in ridges_of(information):
        related, best = information.correlation_of(ridge.mu_s, ridge.v_stribeck), ridge.best_power(information)
        estimates = [ridge.estimate(information, power) for power in (best, WORK)]
        if related > -_STRONG or not np.isfinite(estimates[0].std):
            continue
        powers = zip((best, WORK), estimates, strict=True)
        known = [f"{ridge.text(power)} to {each.std / abs(each.value):.2g}" for power, each in powers]
        alone = information.std_errors[ridge.v_stribeck] / ridge.speed
        seen = f"correlate by {related:.4f}" if np.isfinite(related) else "cannot be distinguished"
        yield (
            f"{ridge.mu_s} and {ridge.v_stribeck} {seen}: the run determines {known[0]} of its value, but {known[1]} "
            f"and {ridge.v_stribeck} to {alone:.2g}. Fix one of the two."
        )


def _on_coefficients(information: Information) -> Iterator[str]:
    """Yield advice on correlated and on poorly determined coefficients."""
    ridges = [{ridge.mu_s, ridge.v_stribeck} for ridge in ridges_of(information)]
    machine = [name for name in information.names if name not in NUISANCES]
    for first, second in itertools.combinations(machine, 2):
        related = information.correlation_of(first, second)
        decay = {"damping", "mu"} == {name.rsplit(".", 1)[-1] for name in (first, second)}
        if not abs(related) >= (_LOOKS_ALIKE if decay else _STRONG) or {first, second} in ridges:
            continue
        text = f"{first} and {second} correlate by {related:.3f}"
        if decay:
            text += ": the linear decay of friction and the exponential one of damping look much alike in this run"
            yield f"{text}. A prior on damping from a ring-down without contact helps."
        else:
            yield f"{text}. An independent value of one makes the other far better known."
    for name in machine:
        share = information.std_errors[name] / abs(information.values[name]) if information.values[name] else 0.0
        if _WEAK < share < np.inf:
            yield f"{name} is hardly determined: its expected standard error is {share:.2g} of its value."
