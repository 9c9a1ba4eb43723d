"""Passivity of friction laws.

On any path, the work of friction on the mass is at most the stored energy.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.cases.case import LOAD
from tests.helpers import LAWS
from tests.tiers import cases


def extracted_work(law, v: np.ndarray, dt: float, z0: jax.Array) -> float:
    """Largest work [J] that a law returns along a history of velocities.

    RK4 integrates the internal states.
    """
    load = jnp.asarray(LOAD)

    def step(carry, pair):
        z, work = carry
        a, b = pair
        middle = (a + b) / 2
        k1 = law.rate(a, z, load)
        k2 = law.rate(middle, z + dt / 2 * k1, load)
        k3 = law.rate(middle, z + dt / 2 * k2, load)
        k4 = law.rate(b, z + dt * k3, load)
        after = law.return_map(b, (b - a) / dt, z + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4), load)
        power = (law.force(a, z, load) * a + law.force(b, after, load) * b) / 2
        return (after, work - dt * power), work - dt * power

    _, work = jax.lax.scan(step, (z0, jnp.zeros(())), (jnp.asarray(v[:-1]), jnp.asarray(v[1:])))
    return float(jnp.max(work))


@pytest.mark.parametrize(
    "name", cases([name for name, case in LAWS.items() if case.passive], ["Dahl", "LuGre", "MaxwellSlip"])
)
def test_no_more_work_comes_back_than_the_bristles_store(name):
    law = LAWS[name].law
    t = np.linspace(0, 0.4, 160_001)
    v = 0.03 * np.sin(90 * t) + 0.02 * np.sin(311 * t + 1) + 0.01 * np.sin(1003 * t + 2)
    z0 = law.steady_state(jnp.asarray(1e-9), jnp.asarray(1.0), jnp.asarray(LOAD))
    stored = LAWS[name].static * float(jnp.sum(z0)) / 2
    assert extracted_work(law, v, t[1], z0) <= stored + 1e-9


def test_the_lugre_coefficients_of_1995_give_work_back():
    # With sigma2 < sigma1 (F_s - F_c)/F_c, a jump from slow to fast motion extracts work proportional to the speed.
    law = LAWS["LuGre not passive"].law
    load, jump = jnp.asarray(LOAD), jnp.asarray(1.0)
    slow = law.steady_state(jnp.asarray(1e-9), jnp.asarray(1.0), load)
    assert law.force(jump, slow, load) * jump < 0
    passive = LAWS["LuGre static"].law
    slow = passive.steady_state(jnp.asarray(1e-9), jnp.asarray(1.0), load)
    assert passive.force(jump, slow, load) * jump > 0
