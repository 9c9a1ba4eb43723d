"""Ring-down calibration: natural frequency, damping and what else the rig itself dissipates, without contact.

The rig swings freely with the sample lifted off. Beside the viscous damping of air film and springs there may be
drag, quadratic in the velocity, the friction of guides, seen as a residual dead band, and a spring that stiffens. A
trace knows no mass, so that all of them are found per unit mass.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..data import Record
from ..data.gather import record_of
from ..fitting import Fit, fit
from ..fitting.result import FitError
from ..friction import Coulomb
from ..oscillator import Oscillator
from ..oscillator.restoring import AbstractRestoring, Cubic, Linear, Pendulum
from ..rig.inputs import check_restoring
from ..rig.measured import Measured
from .ringdown_calibration import SIGNIFICANT, TERMS, RingdownCalibration, Term

_SPRINGS = {"linear": Linear, "cubic": Cubic, "pendulum": Pendulum}


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
    is negative. The noise is taken from the scatter of the residuals, with what memory it shows.

    Args:
        record: the run, given as to :func:`fricjax.fit`; its decay should span a factor of ten or more in amplitude.
        restoring: restoring force or its name: linear (None), cubic, of which the coefficient is fitted as well, or
            pendulum.
        drag: whether to look for quadratic drag.
        friction: whether to look for a residual dead band.

    Returns:
        The calibration, with a note for each term that is not significant.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: an unknown restoring force.
        DataError: a record that cannot be fitted.
        FitError: the decay is not that of a free oscillator.

    ```python
    fricjax.calibrate_ringdown("free.csv").summary()
    ```
    """
    record = record_of(record)
    spring = _spring(restoring)
    wanted = {"mu": friction, "drag": drag, "k3": isinstance(spring, Cubic)}
    asked = tuple(name for name in TERMS if wanted[name])
    fits = _fits(record, spring, asked)
    kept = _best(fits)
    return RingdownCalibration(
        frequency=_measured(fits[kept], "natural_frequency"),
        damping_ratio=_measured(fits[kept], "damping_ratio"),
        terms=tuple(_term(name, fits[kept if name in kept else asked], name in kept) for name in asked),
        warnings=fits[kept].warnings,
        aicc={_label(terms): found.aicc - fits[kept].aicc for terms, found in fits.items()},
        fit=fits[kept],
    )


def _spring(restoring: str | AbstractRestoring | None) -> AbstractRestoring:
    """The restoring force by name or instance; a cubic one starts without its cubic term."""
    if isinstance(restoring, AbstractRestoring):
        return Cubic(0.0) if isinstance(restoring, Cubic) else restoring
    name = "linear" if restoring is None else str(restoring)
    check_restoring(name)
    return Cubic(0.0) if name == "cubic" else _SPRINGS[name]()


def _fits(record: Record, spring: AbstractRestoring, asked: tuple[str, ...]) -> dict[tuple[str, ...], Fit]:
    """The fits by their further terms: none of those asked for, all, and the significant ones.

    Raises:
        FitError: that with all terms is not valid.
    """
    fits = {terms: _fitted(record, spring, terms) for terms in dict.fromkeys(((), asked))}
    full = fits[asked]
    if not full.optimum_found:
        raise FitError(f"The decay is not that of a free oscillator: {full.status}", full)
    terms = tuple(name for name in asked if _score(full, name) > SIGNIFICANT)
    return fits if terms in fits else {**fits, terms: _fitted(record, spring, terms)}


def _best(fits: Mapping[tuple[str, ...], Fit]) -> tuple[str, ...]:
    """Terms of the fit with the lowest criterion among the valid ones in which no term feeds the motion.

    Raises:
        FitError: there is none.
    """
    passive = [
        terms
        for terms, found in fits.items()
        if found.optimum_found and all(_score(found, name) > -SIGNIFICANT for name in terms)
    ]
    if not passive:
        raise FitError(
            "The decay is not that of a free oscillator: friction or drag would feed it.", fits[max(fits, key=len)]
        )
    return min(passive, key=lambda terms: fits[terms].aicc)


def _fitted(record: Record, spring: AbstractRestoring, terms: Sequence[str]) -> Fit:
    """The fit of a machine of unit mass under unit load. A dead band may come out negative, by its noise."""
    shape = Linear() if isinstance(spring, Cubic) and "k3" not in terms else spring
    machine = Oscillator(1.0, 1.0, 0.0, 1.0, Coulomb(0.0), restoring=shape)
    bounds = {"mu": (None, None)} if "mu" in terms else {}
    guess = _stiffening(record) if "k3" in terms else {}
    free = ("damping", "stiffness", *terms)
    return fit(record, machine, free, bounds=bounds, guess=guess, sigma_mode="estimate", throw=False)


def _stiffening(record: Record) -> dict[str, float]:
    """Start values of a cubic spring: the line ``w^2 = k + (3/4) k3 a^2`` through the half-cycles (Duffing, 1918)."""
    found = record.segmentation
    squares = (np.diff(found.turning_points) / 2) ** 2
    slope, stiffness = np.polyfit(squares, (np.pi / np.diff(found.turning_times)) ** 2, 1)
    return {"stiffness": float(stiffness), "k3": float(slope) / 0.75}


def _score(found: Fit, name: str) -> float:
    """A term in standard uncertainties; positive where it dissipates, and always for the spring, that may do either."""
    score = found.values[name] / found.std_errors[name]
    return abs(score) if name == "k3" else score


def _measured(found: Fit, name: str) -> Measured:
    """A kinematic quantity of a fit."""
    estimate = found.kinematics[name]
    return Measured(estimate.value, estimate.std)


def _term(name: str, found: Fit, kept: bool) -> Term:
    """A further term as a fit tells it, per unit mass."""
    kinematic = {"mu": "dead_band", "drag": "drag_rate"}
    if name in kinematic:
        return Term(name, _measured(found, kinematic[name]), kept)
    return Term(name, Measured(found.values[name], found.std_errors[name]), kept)


def _label(terms: Sequence[str]) -> str:
    return " + ".join(["damping", *(TERMS[name].title for name in terms)])
