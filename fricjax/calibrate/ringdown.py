"""Calibration without contact: frequency and damping from one ring-down, the moving mass from two.

The rig swings freely with the sample lifted off. Beside the viscous damping of air film and springs there may be air
drag, quadratic in the velocity, the friction of guides, seen as a residual dead band, and a spring that stiffens. A
trace knows no mass, so that all of them are estimated per unit mass.

The mass comes from the frequencies without and with a known mass on top. The same spring swings both,
``k = m w1^2 = (m + dm) w2^2``, so that ``m = dm/(w1^2/w2^2 - 1)``. Frequencies are known to 1e-6 from a ring-down and
masses to 1e-5 from a balance: this is the best way to the mass, and with it to the stiffness. Leaf springs that carry
load change their stiffness with it: put the mass where it loads them as before.
"""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .. import thresholds
from ..data import Record
from ..data.gather import record_of
from ..errors import UsageError
from ..fitting import Fit, fit
from ..fitting.result import FitError
from ..friction import Coulomb
from ..oscillator import Oscillator
from ..oscillator.restoring import AbstractRestoring, Cubic, Linear, Pendulum
from ..rig.inputs import check_restoring
from ..rig.measured import Measured, positive, propagated
from ..rig.quantity import quantity
from ..rig.rig import Number
from .ringdown_calibration import TERMS, RingdownCalibration, Term

# A cubic spring starts straight.
_SPRINGS: Mapping[str, Callable[[], AbstractRestoring]] = {
    "linear": Linear,
    "cubic": lambda: Cubic(0.0),
    "pendulum": Pendulum,
}


def calibrate_added_mass(frequency: Number, frequency_loaded: Number, added_mass: Number) -> Measured:
    """The moving mass [kg].

    Args:
        frequency: undamped natural frequency of the bare rig [Hz], as a number, a `Measured` or a text with a unit.
        frequency_loaded: the same with the mass added [Hz].
        added_mass: the mass added [kg].

    Returns:
        The mass with its standard uncertainty to first order; for a rotary rig the moment of inertia [kg m^2].

    Raises:
        UsageError: a value that is not positive, or a loaded frequency that is not the lower one.

    Examples:
        >>> import fricjax as fj
        >>> fj.calibrate_added_mass("12.60000(2) Hz", "11.30000(2) Hz", "100.000(1) g")
        0.410975(11)
    """
    bare = positive("frequency", "Hz", quantity("frequency", frequency))
    loaded = positive("frequency_loaded", "Hz", quantity("frequency", frequency_loaded))
    added = positive("added_mass", "kg", quantity("mass", added_mass))
    if not loaded.value < bare.value:
        raise UsageError(
            f"frequency_loaded must be lower than frequency, for mass slows a spring down; got {loaded.value:.9g} Hz "
            f"with and {bare.value:.9g} Hz without the added mass. Perhaps they are swapped."
        )
    # The difference of the squares is factored, which keeps its digits where the frequencies are close.
    return propagated(lambda f1, f2, dm: dm * f2**2 / ((f1 - f2) * (f1 + f2)), bare, loaded, added)


def calibrate_ringdown(
    record: Any,
    *,
    restoring: str | AbstractRestoring | None = None,
    drag: bool = True,
    friction: bool = True,
) -> RingdownCalibration:
    """Frequency and damping of a rig from a free decay without contact.

    The decay is fitted with viscous damping alone, with all further terms, and with those of the further terms that
    exceed three standard uncertainties. Akaike's criterion chooses between the fits in which neither drag nor dead band
    are negative. The noise is taken from the scatter of the residuals, with what memory it shows.

    Args:
        record: the run, given as to :func:`fricjax.fit`; its decay should span a factor of ten or more in amplitude.
        restoring: restoring force or its name: linear (None), cubic, of which the coefficient is fitted as well, or
            pendulum.
        drag: whether to estimate a quadratic drag.
        friction: whether to estimate a residual dead band.

    Returns:
        The calibration, with a note for each term that is not significant.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: an unknown restoring force.
        DataError: a record that cannot be fitted.
        FitError: the decay is not that of a free oscillator.

    Examples:
        >>> import fricjax as fj
        >>> free = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.0))
        >>> record = fj.synthetic_run(free, 2e-3, rate=1000.0, duration=2.0, noise=1e-8, seed=1)
        >>> calibration = fj.calibrate_ringdown(record, drag=False, friction=False)
        >>> print(f"{calibration.frequency.value:.4f} Hz, {calibration.damping_ratio.value:.5f}")
        12.6105 Hz, 0.00277
    """
    record = record_of(record)
    if isinstance(restoring, AbstractRestoring):
        spring = Cubic(0.0) if isinstance(restoring, Cubic) else restoring
    else:
        name = "linear" if restoring is None else str(restoring)
        check_restoring(name)
        spring = _SPRINGS[name]()
    wanted = {"mu": friction, "drag": drag, "k3": isinstance(spring, Cubic)}
    asked = tuple(name for name in TERMS if wanted[name])
    fits = _fits(record, spring, asked)
    kept = _best(fits)
    title = lambda terms: " + ".join(["damping", *(TERMS[name].title for name in terms)])
    return RingdownCalibration(
        frequency=_kinematic(fits[kept], "natural_frequency"),
        damping_ratio=_kinematic(fits[kept], "damping_ratio"),
        # A term that was left out is told as the fit with all of them has it.
        terms=tuple(Term(name, _term(name, fits[kept if name in kept else asked]), name in kept) for name in asked),
        warnings=fits[kept].warnings,
        aicc={title(terms): candidate.aicc - fits[kept].aicc for terms, candidate in fits.items()},
        fit=fits[kept],
    )


def _fits(record: Record, spring: AbstractRestoring, asked: tuple[str, ...]) -> dict[tuple[str, ...], Fit]:
    """The fits by their further terms: none of those asked for, all, and the significant ones.

    Raises:
        FitError: that with all terms is not valid.
    """
    fits = {terms: _fit(record, spring, terms) for terms in dict.fromkeys(((), asked))}
    full = fits[asked]
    if not full.optimum_found:
        raise FitError(f"The decay is not that of a free oscillator: {full.status}", full)
    terms = tuple(name for name in asked if _score(full, name) > thresholds.SUSPECTED)
    return fits if terms in fits else {**fits, terms: _fit(record, spring, terms)}


def _best(fits: Mapping[tuple[str, ...], Fit]) -> tuple[str, ...]:
    """Terms of the fit with the lowest criterion among the valid ones in which no term feeds the motion.

    Raises:
        FitError: there is none.
    """
    passive = [
        terms
        for terms, candidate in fits.items()
        if candidate.optimum_found and all(_score(candidate, name) > -thresholds.SUSPECTED for name in terms)
    ]
    if not passive:
        raise FitError(
            "The decay is not that of a free oscillator: friction or drag would feed it.", fits[max(fits, key=len)]
        )
    return min(passive, key=lambda terms: fits[terms].aicc)


def _fit(record: Record, spring: AbstractRestoring, terms: Sequence[str]) -> Fit:
    """The fit of a machine of unit mass under unit load."""
    linear = isinstance(spring, Cubic) and "k3" not in terms
    machine = Oscillator(1.0, 1.0, 0.0, 1.0, Coulomb(0.0), restoring=Linear() if linear else spring)
    # By its noise a dead band of zero comes out negative in half of all decays.
    bounds = {"mu": (None, None)} if "mu" in terms else {}
    guess = {}
    if "k3" in terms:
        # Half-cycles of amplitude a have w^2 = k + (3/4) k3 a^2 (Duffing, 1918).
        reversals = record.segmentation
        squares = (np.diff(reversals.turning_points) / 2) ** 2
        slope, stiffness = np.polyfit(squares, (np.pi / np.diff(reversals.turning_times)) ** 2, 1)
        guess = {"stiffness": float(stiffness), "k3": float(slope) / 0.75}
    free = ("damping", "stiffness", *terms)
    return fit(record, machine, free, bounds=bounds, guess=guess, sigma_mode="estimate", throw=False)


def _score(fit: Fit, name: str) -> float:
    """A term in standard uncertainties; positive where it dissipates, and always for the spring, that may do either."""
    score = fit.values[name] / fit.std_errors[name]
    return abs(score) if name == "k3" else score


def _kinematic(fit: Fit, name: str) -> Measured:
    return dataclasses.replace(fit.kinematics[name], unit=None)


def _term(name: str, fit: Fit) -> Measured:
    """A further term per unit mass; the dead band as it is."""
    if name == "k3":
        return Measured(fit.values[name], fit.std_errors[name])
    return _kinematic(fit, {"mu": "dead_band", "drag": "drag_rate"}[name])
