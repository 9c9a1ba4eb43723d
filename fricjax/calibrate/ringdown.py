"""Calibration without contact, from ring-downs.

One ring-down gives frequency and damping, two give the moving mass. The rig swings freely with the sample lifted off.
In addition to the viscous damping of air film and springs, the model can include air drag (quadratic in the velocity),
friction of guides (a residual dead band), and a stiffening spring. A trace contains no information on the mass, so all
of them are estimated per unit mass.

The mass follows from the frequencies without and with a known added mass. The spring is the same,
``k = m w1^2 = (m + dm) w2^2``, so ``m = dm/(w1^2/w2^2 - 1)``. A ring-down gives the frequency to 1e-6 and a balance the
mass to 1e-5, so this is the best method for the moving mass and the stiffness. The stiffness of leaf springs depends on
their load: place the added mass so that this load does not change.
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

# The fit of a cubic spring starts from a linear one.
_SPRINGS: Mapping[str, Callable[[], AbstractRestoring]] = {
    "linear": Linear,
    "cubic": lambda: Cubic(0.0),
    "pendulum": Pendulum,
}


def calibrate_added_mass(frequency: Number, frequency_loaded: Number, added_mass: Number) -> Measured:
    """Compute the moving mass [kg] from the effect of an added mass.

    Args:
        frequency: undamped natural frequency of the bare rig [Hz], as a number, a `Measured` or a text with a unit.
        frequency_loaded: the same with the added mass [Hz].
        added_mass: the added mass [kg].

    Returns:
        The mass with its standard uncertainty to first order; for a rotary rig the moment of inertia [kg m^2].

    Raises:
        UsageError: a value is not positive, or the loaded frequency is not lower.

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
    # Factoring the difference of squares avoids cancellation for close frequencies.
    return propagated(lambda f1, f2, dm: dm * f2**2 / ((f1 - f2) * (f1 + f2)), bare, loaded, added)


def calibrate_ringdown(
    record: Any,
    *,
    restoring: str | AbstractRestoring | None = None,
    drag: bool = True,
    friction: bool = True,
) -> RingdownCalibration:
    """Estimate frequency and damping of a rig from a decay without contact.

    Three models are fitted: viscous damping alone, all further terms, and the further terms that exceed three standard
    uncertainties. Akaike's criterion selects among the fits in which neither drag nor dead band is negative. The noise
    is estimated from the residuals, including their correlation.

    Args:
        record: the run, in any form that :func:`fricjax.fit` accepts; the amplitude should decay by a factor of ten or
            more.
        restoring: restoring force or its name: linear (None), cubic (the coefficient is then fitted too), or pendulum.
        drag: whether to estimate a quadratic drag.
        friction: whether to estimate a residual dead band.

    Returns:
        The calibration, with a note for each term that is not significant.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: the restoring force is unknown.
        DataError: the record cannot be fitted.
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
        # The value of a term that was left out comes from the fit with all terms.
        terms=tuple(Term(name, _term(name, fits[kept if name in kept else asked]), name in kept) for name in asked),
        warnings=fits[kept].warnings,
        aicc={title(terms): candidate.aicc - fits[kept].aicc for terms, candidate in fits.items()},
        fit=fits[kept],
    )


def _fits(record: Record, spring: AbstractRestoring, asked: tuple[str, ...]) -> dict[tuple[str, ...], Fit]:
    """Fit the decay without, with all and with significant further terms.

    Raises:
        FitError: the fit with all terms is not valid.
    """
    fits = {terms: _fit(record, spring, terms) for terms in dict.fromkeys(((), asked))}
    full = fits[asked]
    if not full.optimum_found:
        raise FitError(f"The decay is not that of a free oscillator: {full.status}", full)
    terms = tuple(name for name in asked if _score(full, name) > thresholds.SUSPECTED)
    return fits if terms in fits else {**fits, terms: _fit(record, spring, terms)}


def _best(fits: Mapping[tuple[str, ...], Fit]) -> tuple[str, ...]:
    """Return the terms of the best valid fit with dissipative terms only.

    Raises:
        FitError: there is no such fit.
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
    """Fit a machine of unit mass under unit load."""
    linear = isinstance(spring, Cubic) and "k3" not in terms
    machine = Oscillator(1.0, 1.0, 0.0, 1.0, Coulomb(0.0), restoring=Linear() if linear else spring)
    # Because of noise, the estimate of a dead band of zero is negative in half of all decays.
    bounds = {"mu": (None, None)} if "mu" in terms else {}
    guess = {}
    if "k3" in terms:
        # A half-cycle of amplitude a has w^2 = k + (3/4) k3 a^2 (Duffing, 1918).
        reversals = record.segmentation
        squares = (np.diff(reversals.turning_points) / 2) ** 2
        slope, stiffness = np.polyfit(squares, (np.pi / np.diff(reversals.turning_times)) ** 2, 1)
        guess = {"stiffness": float(stiffness), "k3": float(slope) / 0.75}
    free = ("damping", "stiffness", *terms)
    return fit(record, machine, free, bounds=bounds, guess=guess, sigma_mode="estimate", throw=False)


def _score(fit: Fit, name: str) -> float:
    """Term over its standard uncertainty; positive for dissipation.

    The cubic term does not dissipate, so its score is the absolute value.
    """
    score = fit.values[name] / fit.std_errors[name]
    return abs(score) if name == "k3" else score


def _kinematic(fit: Fit, name: str) -> Measured:
    return dataclasses.replace(fit.kinematics[name], unit=None)


def _term(name: str, fit: Fit) -> Measured:
    """Further term per unit mass; the dead band is not scaled."""
    if name == "k3":
        return Measured(fit.values[name], fit.std_errors[name])
    return _kinematic(fit, {"mu": "dead_band", "drag": "drag_rate"}[name])
