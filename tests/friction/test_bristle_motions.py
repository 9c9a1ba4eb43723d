"""Motions and derivatives under every law with internal states against SciPy.

The tolerance of the motions is a tenth of a nanometre.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fricjax.friction as friction
from experiments.laws.scipy_laws import reference
from fricjax.oscillator import Oscillator, simulate
from tests.friction.machines import ROLLING, SLIDING, TENTH_OF_A_NANOMETRE, TS, X0, motion

pytestmark = pytest.mark.slow

_BRUSH = {"mu": 0.05, "mu_s": 0.065, "v_stribeck": 5e-3, "sigma0": 1e5, "sigma1": 284.0, "sigma2": 0.0}
_AGEING = {"slip_distance": 2e-6, "v_reference": 1e-6}
CASES = {
    "Dahl rolling": (ROLLING, {"mu": 0.01, "sigma0": 1e5}),
    "Dahl exponent": (ROLLING, {"mu": 0.01, "sigma0": 1e5, "exponent": 1.5}),
    "Dahl sliding": (SLIDING, {"mu": 0.05, "sigma0": 1e5}),
    "BoucWen rolling": (ROLLING, {"mu": 0.01, "sigma0": 1e5, "n": 2.0, "beta": 0.7}),
    "BoucWen sliding": (SLIDING, {"mu": 0.05, "sigma0": 1e5, "n": 1.0, "beta": 0.6}),
    "Rolling": (ROLLING, {"mu": 0.01, "length": 1e-4, "load_exponent": 1 / 3}),
    "BlimanSorine": (ROLLING, {"mu1": 0.015, "mu2": 0.005, "eta": 0.3, "epsilon": 1e-6}),
    "ElastoPlastic": (SLIDING, {**_BRUSH, "breakaway_fraction": 0.5}),
    "LuGre": (SLIDING, {**_BRUSH, "v_damping": 0.01}),
    "RateState rolling": (ROLLING, {"mu": 0.01, "a": 0.001, "b": 0.0008, **_AGEING}),
    "RateState sliding": (SLIDING, {"mu": 0.05, "a": 0.002, "b": 0.003, **_AGEING}),
    "RateStateSlip": (ROLLING, {"mu": 0.01, "a": 0.001, "b": 0.0012, **_AGEING}),
}


@pytest.mark.parametrize("name", CASES)
def test_motion(name: str):
    machine, coefficients = CASES[name]
    law = name.split()[0]
    expected = reference(law, coefficients, machine, X0, TS)
    found = motion(law, coefficients, machine).x
    np.testing.assert_allclose(found, expected, rtol=0, atol=TENTH_OF_A_NANOMETRE)


def test_the_reference_is_a_hundredth_of_a_nanometre():
    machine, coefficients = CASES["Dahl sliding"]
    by_lsoda = reference("Dahl", coefficients, machine, X0, TS)
    by_radau = reference("Dahl", coefficients, machine, X0, TS, method="Radau", rtol=1e-10)
    np.testing.assert_allclose(by_lsoda, by_radau, rtol=0, atol=1e-11)


CONTACTS = {
    "Dahl": {"mu": 0.05, "sigma0": 1e5, "exponent": 1.5},
    "BoucWen": {"mu": 0.05, "sigma0": 1e5, "n": 2.0, "beta": 0.7},
    "ElastoPlastic": {**_BRUSH, "sigma2": 2.0, "breakaway_fraction": 0.5},
}


@pytest.mark.parametrize("name", CONTACTS)
def test_derivatives(name: str):
    names, scale = list(CONTACTS[name]), np.array(list(CONTACTS[name].values()))

    def run(relative: jax.Array, accuracy: float = 1e-10) -> jax.Array:
        law = getattr(friction, name)(**dict(zip(names, relative * scale, strict=True)))
        return simulate(Oscillator(*SLIDING, law), X0, TS, accuracy=accuracy).x

    ones, h = jnp.ones(scale.size), 1e-3
    for tangent in jnp.eye(scale.size):
        slope = jax.jvp(run, (ones,), (tangent,))[1]
        near, far = (
            (run(ones + n * h * tangent, 1e-13) - run(ones - n * h * tangent, 1e-13)) / (2 * n * h) for n in (1, 2)
        )
        error = np.linalg.norm(slope - (4 * near - far) / 3) / np.linalg.norm(slope)
        print(names[int(jnp.argmax(tangent))], f"{error:.1e}")
        assert error < 1e-4
