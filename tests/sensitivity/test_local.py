"""Derivatives of a motion against central differences and a closed form."""

import jax
import numpy as np
import pytest

from fricjax.errors import UsageError
from fricjax.friction import Coulomb, LuGre, Stribeck
from fricjax.oscillator import simulate
from fricjax.oscillator.oscillator import leaves_of
from fricjax.sensitivity import local
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.sensitivity.machines import SLIDING, STIFFNESS, prototype

TIMES = np.linspace(0.0, 0.14, 57)
X0 = 1e-3

LAWS = {
    "exact": (Coulomb(0.05), ["mu", "mass", "damping", "x0", "offset", "t_release"], 1e-6),
    "hybrid": (Stribeck(0.05, 0.06, 5e-3), ["mu_s", "v_stribeck", "stiffness", "drag"], 1e-5),
    "smooth": (LuGre(0.05, sigma0=1e5), ["mu", "sigma0", "normal_force", "x0"], 1e-4),
}


def moved(oscillator, name, change, engine):
    """Reading after a change of one coefficient or number of the run."""
    leaves, structure = jax.tree.flatten(oscillator)
    index = {leaf.name: leaf.index for leaf in leaves_of(oscillator)}
    if name in index:
        leaves[index[name]] = leaves[index[name]] + change
    machine = jax.tree.unflatten(structure, leaves)
    own = {"x0": 0.0, "offset": 0.0, "t_release": 0.0} | {name: change}
    motion = simulate(machine, X0 + own["x0"], TIMES - own["t_release"], engine=engine, accuracy=1e-12)
    return np.asarray(motion.x) + own["offset"]


@pytest.mark.slow
@pytest.mark.parametrize("engine", LAWS)
def test_against_central_differences(engine):
    law, names, tolerance = LAWS[engine]
    oscillator = prototype(law)
    found = local(oscillator, X0, TIMES, names, engine=engine)
    values = dict(zip([leaf.name for leaf in leaves_of(oscillator)], jax.tree.leaves(oscillator), strict=True))
    sizes = {name: float(value) or 1.0 for name, value in values.items()} | {"x0": X0, "offset": X0, "t_release": 0.04}
    for name, column in zip(names, found.T, strict=True):
        step = 1e-4 * sizes[name]
        near, far = (
            (moved(oscillator, name, h, engine) - moved(oscillator, name, -h, engine)) / (2 * h)
            for h in (step, 2 * step)
        )
        differences = (4 * near - far) / 3
        scale = np.max(np.abs(differences))
        np.testing.assert_allclose(column, differences, rtol=0, atol=tolerance * scale, err_msg=name)


def test_the_order_is_that_of_the_names_and_a_static_coefficient_has_no_gradient():
    omega, zeta = np.sqrt(STIFFNESS / PROTOTYPE_MASS), PROTOTYPE_DAMPING / (2 * np.sqrt(STIFFNESS * PROTOTYPE_MASS))
    rho = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2))
    reversal = np.pi / (omega * np.sqrt(1 - zeta**2))
    found = local(prototype(Coulomb(0.05, 0.06)), X0, np.array([0.0, reversal]), ["offset", "mu_s", "mu", "x0"])
    # At the first reversal x = x_d - rho (x0 - x_d), with x_d = mu N/k.
    expected = [[1, 0, 0, 1], [1, 0, (1 + rho) * SLIDING / STIFFNESS, -rho]]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(
    "names, ts, message",
    [
        (["muu"], TIMES, "has no coefficient 'muu'"),
        (["mu", "mu"], TIMES, "mu is named twice"),
        ([], TIMES, "No parameter is named"),
        (["mu"], [0.0, 0.0], "must be a list of increasing times"),
    ],
)
def test_what_is_refused(names, ts, message):
    with pytest.raises(UsageError, match=message):
        local(prototype(Coulomb(0.05)), X0, ts, names)
