"""Modified Leuven model against event-driven integration, closed forms and its limits."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from experiments.laws.scipy_slip import LeuvenContact, event_driven
from fricjax.friction import Leuven
from fricjax.oscillator import Oscillator, simulate

M, K, C, N = 0.41068, 2574.0, 0.17557, 9.66
RIG = {"mass": M, "stiffness": K, "damping": C}
TS = np.linspace(0, 0.1, 201)
STIFFNESSES, SHARES = np.array([6e4, 3e4, 1e4]), np.array([0.3, 0.3, 0.4])
VALUES = {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 2e-2, "exponent": 1.5, "sigma1": 20.0}
LOAD, REST = jnp.asarray(2.0), jnp.zeros(())


def motion(mu, mu_s, v_stribeck, exponent, sigma1, accuracy=1e-10):
    law = Leuven(mu, mu_s, v_stribeck, tuple(STIFFNESSES), tuple(SHARES[:-1]), exponent, sigma1)
    return simulate(Oscillator(M, K, C, N, law), 2e-3, TS, accuracy=accuracy).x


def reference(mu, mu_s, v_stribeck, exponent, sigma1):
    contact = LeuvenContact(
        2e-3, **RIG, kinetic=mu * N, static=mu_s * N, v_stribeck=v_stribeck, stiffnesses=STIFFNESSES, shares=SHARES,
        exponent=exponent, sigma1=sigma1,
    )  # fmt: skip
    return event_driven(TS, contact.start, contact, 1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{}, {"mu_s": 0.05}, {"exponent": 1.0, "v_stribeck": 5e-3}])
def test_motion_below_a_tenth_of_a_nanometre(changes: dict[str, float]):
    values = {**VALUES, **changes}
    np.testing.assert_allclose(motion(**values), reference(**values), rtol=0, atol=2e-11)


@pytest.mark.slow
def test_derivatives_agree_with_differences_of_the_event_driven_motion():
    values, direction = np.array(list(VALUES.values())), np.array([1.0, 0.7, -0.5, 0.3, 0.8])
    at = lambda h: dict(zip(VALUES, values * (1 + h * direction), strict=True))
    _, slope = jax.jvp(lambda h: motion(**at(h)), (jnp.zeros(()),), (jnp.ones(()),))
    difference = (reference(**at(1e-4)) - reference(**at(-1e-4))) / 2e-4
    assert np.linalg.norm(slope - difference) < 1e-5 * np.linalg.norm(difference)


@pytest.mark.slow
@pytest.mark.parametrize("changes", [{}, {"exponent": 1.0, "mu": 0.01, "mu_s": 0.012}])
def test_elements_that_creep_back_do_so_from_their_limits(changes: dict[str, float]):
    """Start the creep of elements at their limits.

    A slider cuts off the deflection at the limit. A step from a larger deflection would cause an error that
    the error estimate does not include.
    """
    values = {**VALUES, **changes}
    found = motion(**values, accuracy=1e-12)
    np.testing.assert_allclose(found, reference(**values), rtol=0, atol=2e-13)


def forces_along(law: Leuven, x: np.ndarray) -> np.ndarray:
    """Hysteresis force at positions `x` of a slow movement, by RK4.

    The contact is initially virgin.
    """

    def move(z, step):
        v = jnp.sign(step)
        h, z = jnp.abs(step), law.return_map(v, REST, z, LOAD)
        k1 = law.rate(v, z, LOAD)
        k2 = law.rate(v, z + h / 2 * k1, LOAD)
        k3 = law.rate(v, z + h / 2 * k2, LOAD)
        z = law.return_map(v, REST, z + h / 6 * (k1 + 2 * k2 + 2 * k3 + law.rate(v, z + h * k3, LOAD)), LOAD)
        return z, law.force(v, z, LOAD)

    return np.asarray(jax.lax.scan(move, jnp.zeros(law.n_states), jnp.diff(jnp.asarray(x)))[1])


def test_one_element_and_an_exponent_of_one_are_dahls_curve():
    # From a virgin contact dz/dx = 1 - z/l. After the reversal at F_b, the distance to the new limit decays with l'.
    law, force, length = Leuven(0.1, stiffnesses=(1e4,)), 0.2, 0.2 / 1e4
    out = np.linspace(0, 2 * length, 2001)
    back = out[-1] - np.linspace(0, 3 * length, 3001)
    measured = forces_along(law, np.concatenate([out, back[1:]]))
    np.testing.assert_allclose(measured[:2000], force * (1 - np.exp(-out[1:] / length)), rtol=1e-9)
    turned = force * (1 - np.exp(-2.0))
    way = (out[-1] - back[1:]) / (length * (1 + turned / force))
    np.testing.assert_allclose(measured[2000:], -force + (force + turned) * np.exp(-way), atol=1e-9 * force)


def test_a_sudden_transition_leaves_the_elements_until_they_all_yield():
    law = Leuven(0.1, stiffnesses=(3e4, 1e4), shares=(0.5,), exponent=100.0)
    x = np.linspace(0, 7e-6, 701)
    expected = np.minimum(3e4 * x, 0.1) + np.minimum(1e4 * x, 0.1)
    np.testing.assert_allclose(forces_along(law, x), expected[1:], rtol=1e-6)


def test_a_force_above_that_of_steady_sliding_falls_even_if_the_last_reversal_was_there():
    law = Leuven(0.1, 0.2, 1e-3, stiffnesses=(1e4,))
    reversal = jnp.asarray([0.35 / 1e4, 0.34 / 1e4, 1e-5])
    fast, slow = jnp.asarray(1.0), jnp.asarray(1e-5)
    assert law.rate(fast, reversal, LOAD)[0] < 0 < law.rate(slow, reversal, LOAD)[0]
    mirrored = law.rate(-fast, -reversal, LOAD)
    np.testing.assert_array_equal(mirrored, -law.rate(fast, reversal, LOAD))


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: Leuven(0.1, exponent=0.5), "exponent of Leuven must lie between 1 and 100, got 0.5."),
        (lambda: Leuven(0.1, sigma1=-1.0), "sigma1 of Leuven must not be negative, got -1.0 N s/m."),
        (lambda: Leuven(0.1, shares=(0.5,)), "Leuven needs a stiffness for each element"),
    ],
)
def test_refusals(build, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        build()
