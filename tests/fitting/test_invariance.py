"""Fits with scaled displacements, times or weights have the same optimum."""

import functools

import numpy as np
import pytest

from fricjax import Fit, Oscillator, Trace, fit
from fricjax.friction import Coulomb, LuGre, Tanh
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import LAWS, MACHINE, RIGS, SIGMA0, SIGMA1, STIFFNESS, V_S, noisy

RIG = RIGS["sliding"]
UNITS = [{"length": 1e6}, {"length": 1e-6}, {"time": 1e6}, {"time": 1e-6}, {"length": 1e-6, "time": 1e6}]
WEIGHTS = [{"noise": 1e3}, {"noise": 1e-6}]  # noise of a millimetre would hide the motion from the search for reversals


def friction(law: str, length: float, time: float):
    """Friction law in other units.

    Velocity scales change with the units; the stiffness of bristles does not.
    """
    speed = length / time
    return {
        "Coulomb": Coulomb(RIG.mu),
        "Tanh": Tanh(RIG.mu, V_S * speed),
        "LuGre": LuGre(RIG.mu, v_stribeck=1e-3 * speed, sigma0=SIGMA0, sigma1=SIGMA1 * time),
    }[law]


def stretched(law: str, length: float = 1.0, time: float = 1.0, noise: float = 1.0, engine: str = "auto") -> Fit:
    """Fit a sliding run in other units.

    All forces scale with the displacement, and the stiffness does not change.
    """
    trace = noisy("sliding", law, 0)
    x, sigma = length * np.asarray(trace.x), length * noise * RIG.noise
    machine = Oscillator(
        time**2 * PROTOTYPE_MASS, STIFFNESS, time * PROTOTYPE_DAMPING, length * RIG.load, friction(law, length, time)
    )
    free = (*MACHINE, "sigma0") if law == "LuGre" else MACHINE
    return fit(Trace(time * np.asarray(trace.t), x, sigma=sigma), machine, free, engine=engine)


plain = functools.cache(stretched)


def back(found: Fit, length: float = 1.0, time: float = 1.0, noise: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """Values and standard errors in the original units.

    The standard errors are those for white noise of the stated size.
    """
    unit = {"t_release": time, "damping": time, "x0": length, "offset": length, "v0": length / time}
    units = np.array([unit.get(name, 1.0) for name in found.names])
    values, errors = (
        np.array([by[name] for name in found.names]) / units for by in (found.values, found.white_std_errors)
    )
    return values, errors / noise


def at_an_instant_of_the_record(found: Fit) -> np.ndarray:
    """Mask of position and velocity at an instant of the record.

    The search for reversals chooses the instant, which depends on rounding.
    """
    return np.array(["v0" in found.names and name in ("x0", "v0") for name in found.names])


# Rounding moves instants by 1e-15, relatively, so samples may cross a margin. The mesh of the smooth engine comes from
# an adaptive solution, which rounding changes by as much as its error.
CLOSE = {"Coulomb": 1e-5, "Tanh": 1e-5, "LuGre": 1e-4}


CASES = [
    *(pytest.param(law, each, marks=() if law == "Coulomb" else pytest.mark.slow) for law in LAWS for each in UNITS),
    *(("Coulomb", units) for units in WEIGHTS),
]


@pytest.mark.parametrize(("law", "units"), CASES, ids=str)
def test_other_units_give_the_same_optimum(law, units):
    # Noise of a wrong size is not white noise of the stated size, so another engine would fit the record.
    engine = "exact" if "noise" in units else "auto"
    reference, found = plain(law, engine=engine), stretched(law, **units, engine=engine)
    values, errors = back(reference)
    there, errors_there = back(found, **units)
    shift = np.abs(there - values) * ~at_an_instant_of_the_record(found)
    print(f"\n{law} {units}: moved by {np.max(shift / errors):.1e} standard errors")
    assert found.status == reference.status == "described"
    assert found.half_cycles == reference.half_cycles
    assert np.max(shift / errors) < CLOSE[law]
    own = np.array([name != "offset" for name in found.names])  # the offset is zero within its standard error
    assert np.max(shift[own] / np.abs(values[own])) < 1e-8
    assert errors_there == pytest.approx(errors, rel=1e-6)
    assert found.chi2 * units.get("noise", 1.0) ** 2 == pytest.approx(reference.chi2, abs=1e-4)


@pytest.mark.parametrize("scale", [1e6, 1e-6])
def test_an_active_bound_is_seen_in_all_units(scale):
    trace = noisy("sliding", "Coulomb", 0)
    data = Trace(np.asarray(trace.t), scale * np.asarray(trace.x), sigma=scale * RIG.noise)
    machine = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, scale * RIG.load, Coulomb(RIG.mu))
    held = fit(data, machine, MACHINE, bounds={"damping": (0.3, None)})
    assert held.flags["damping"] == ("at bound",) and "damping beyond its bound would" in held.status
