"""Signs of a friction law in a decay.

The strokes are built from the energy loss under each law, without simulation.
"""

import numpy as np
import pytest
from scipy.optimize import brentq

from fricjax import Oscillator, Trace
from fricjax.comparison.fingerprints import fingerprints, regress_losses, spring_back
from fricjax.fitting.window import open_window
from fricjax.friction import Coulomb
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import coulomb_viscous

STIFFNESS, LOAD, ZETA = 2574.0, 9.66, 0.0027
MACHINE = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, LOAD, Coulomb(0.02))
BAND = 0.02 * LOAD / STIFFNESS
RATE, HALF, NOISE = 5e3, 0.0396825, 1e-9


def window(t, x, seed=0):
    noisy = x + NOISE * np.random.default_rng(seed).standard_normal(t.size)
    return open_window(Trace(t, noisy, sigma=NOISE), "first_reversal", None, keeps_memory=False, creeps=False)


def strokes(amplitudes, offset=0.0):
    """Join turning points on alternate sides by half cosines, then add rest."""
    points = np.array([(-1) ** i * a for i, a in enumerate(amplitudes)])
    t = np.arange(round((points.size + 1) * HALF * RATE)) / RATE
    i = np.minimum((t / HALF).astype(int), points.size - 2)
    phase = np.pi * np.clip(t / HALF - i, 0, 1)
    return window(t, offset + (points[i] + points[i + 1]) / 2 + (points[i] - points[i + 1]) / 2 * np.cos(phase))


def decay(loss, start, least):
    """Amplitudes of a decay with a given loss per stroke.

    A stroke from a to b loses the energy `loss(a, b)`, in units of the stiffness.
    """
    amplitudes = [start]
    while (a := amplitudes[-1]) > least:
        amplitudes.append(brentq(lambda b: (a**2 - b**2) / 2 - loss(a, b), 0.0, a))
    return amplitudes


@pytest.mark.parametrize("x0", [1.2e-3, 1.43e-3, 1.57e-3, 1.69e-3, 1.81e-3])
def test_coulomb_friction_leaves_no_fingerprint(x0):
    t = np.arange(3000) / RATE
    seen = window(t, coulomb_viscous(t, x0, frequency=12.6, zeta=ZETA, dead_band=BAND, offset=3e-6).x)
    found = regress_losses([seen], MACHINE)
    assert found is not None
    assert found.dead_band == pytest.approx(BAND, rel=1e-3)
    assert found.damping == pytest.approx(PROTOTYPE_DAMPING, rel=2e-2)
    assert spring_back(seen) is None
    assert fingerprints([seen], MACHINE) == ()


def test_what_a_contact_returns_at_each_reversal():
    length = 1e-6
    # Dahl (1968): each reversal returns an energy of 2 F l.
    dahl = lambda a, b: BAND * (a + b) - 2 * BAND * length
    undamped = Oscillator(PROTOTYPE_MASS, STIFFNESS, 0.0, LOAD, Coulomb(0.02))
    seen = [strokes(decay(dahl, start, 2 * BAND), 2e-6) for start in (1.6e-3, 1.9e-3)]
    found = regress_losses(seen, undamped)
    assert found is not None
    assert found.deflection == pytest.approx(length, rel=0.02)
    (sentence,) = fingerprints(seen, undamped)
    assert sentence.startswith("Pre-sliding: each reversal gives back")
    assert "1.9e+05 N/m" in sentence  # mu N/l


def test_friction_that_falls_with_velocity():
    gain, fall = 0.006 * LOAD / STIFFNESS, (5e-3 / (2 * np.pi * 12.6)) ** 2 / 2
    # Extra work around each reversal, because friction falls as exp(-(v/v_s)^2).
    stribeck = lambda a, b: BAND * (a + b) + gain * fall * (1 / (a - BAND) + 1 / (b + BAND))
    seen = strokes(decay(stribeck, 1.9e-3, 2 * BAND))
    (sentence,) = fingerprints([seen], MACHINE)
    assert sentence.startswith("Falling friction")
    assert "negative" in sentence


def test_a_contact_that_springs_back():
    t = np.arange(3000) / RATE
    exact = coulomb_viscous(t, 1.57e-3, frequency=12.6, zeta=ZETA, dead_band=BAND)
    stop, last = exact.stops[-1], np.sign(exact.points[-1] - exact.points[-2])
    back = np.where(t > stop, 800e-9 * last * -np.expm1(-(t - stop) / 2e-3), 0.0)
    seen = window(t, exact.x - back)
    assert spring_back(seen) == pytest.approx(800e-9, rel=0.1)
    (sentence,) = fingerprints([seen], MACHINE)
    assert sentence.startswith("Spring-back: at rest the mass lies 8")


def test_few_half_cycles_tell_of_no_losses():
    t = np.arange(1000) / RATE
    seen = window(t, coulomb_viscous(t, 0.5e-3, frequency=12.6, zeta=ZETA, dead_band=BAND).x)
    assert regress_losses([seen], MACHINE) is None
