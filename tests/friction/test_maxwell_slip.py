"""Maxwell-slip elements against closed forms and an event-driven motion of damped waves."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import fricjax as fj
from experiments.laws.scipy_slip import maxwell_slip
from fricjax.friction import Jenkins, MaxwellSlip
from fricjax.oscillator import Oscillator, simulate

M, K, C = 0.41068, 2574.0, 0.17557
RIG = {"mass": M, "stiffness": K, "damping": C}
ROLLING, SLIDING = (0.01, 1.89), (0.05, 9.66)
TS = np.linspace(0, 0.3, 601)
ONE = jnp.ones(())


def elements(n: int, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """Stiffnesses with the sum 1e5 N/m and limits with the sum `mu`.

    Each element yields at a different deflection.
    """
    stiffnesses, limits = np.geomspace(3, 1, n), np.arange(1, n + 1.0)
    return 1e5 * stiffnesses / stiffnesses.sum(), mu * limits / limits.sum()


def forces_along(law, x: np.ndarray, state: jax.Array) -> np.ndarray:
    """Friction force at the positions `x` of a path."""

    def move(z, step):
        z = law.return_map(jnp.sign(step), 0 * ONE, z + step * law.rate(ONE, z, ONE), ONE)
        return z, law.force(jnp.sign(step), z, ONE)

    return np.asarray(jax.lax.scan(move, state, jnp.diff(jnp.asarray(x)))[1])


@pytest.mark.slow
@pytest.mark.parametrize("n", [1, 4, 10])
def test_motion_below_a_tenth_of_a_nanometre(n: int):
    for mu, load in (ROLLING, SLIDING):
        stiffnesses, limits = elements(n, mu)
        law = Jenkins(mu, 1e5) if n == 1 else MaxwellSlip(tuple(stiffnesses), tuple(limits))
        motion = simulate(Oscillator(M, K, C, load, law), 2e-3, TS)
        expected = maxwell_slip(TS, 2e-3, **RIG, stiffnesses=stiffnesses, forces=limits * load)
        assert motion.engine == "smooth"
        np.testing.assert_allclose(motion.x, expected, rtol=0, atol=1e-11)


@pytest.mark.slow
def test_derivatives_agree_with_differences_of_the_event_driven_motion():
    stiffnesses, limits = elements(4, SLIDING[0])
    ts, values = TS[20::20], np.concatenate([stiffnesses, limits])

    def run(relative):
        at = relative * values
        machine = Oscillator(M, K, C, SLIDING[1], MaxwellSlip(tuple(at[:4]), tuple(at[4:])))
        return simulate(machine, 2e-3, ts).x

    def reference(relative):
        at = relative * values
        return maxwell_slip(ts, 2e-3, **RIG, stiffnesses=at[:4], forces=SLIDING[1] * at[4:])

    pushed = jax.jit(lambda tangent: jax.jvp(run, (jnp.ones(8),), (tangent,))[1])
    jacobian = np.array([pushed(tangent) for tangent in jnp.eye(8)])
    h = 1e-5 * np.eye(8)
    differences = np.array([reference(1 + d) - reference(1 - d) for d in h]) / 2e-5
    error = np.linalg.norm(jacobian - differences, axis=1) / np.linalg.norm(differences, axis=1)
    assert np.all(error < 1e-5), error


@pytest.mark.slow
def test_jenkins_half_cycles():
    # Each reversal returns 2 F_d l: a' = -x_d + sqrt((a - x_d)^2 + 4 x_d l), undamped.
    mu, load, sigma0 = 0.05, 9.66, 1e6
    machine = Oscillator(M, K, 0.0, load, Jenkins(mu, sigma0))
    points = np.abs(simulate(machine, 2e-3, np.linspace(0, 0.18, 7201)).turning_points[:5])
    band, length = mu * load / K, mu * load / sigma0
    expected = [2e-3]
    for _ in range(4):
        expected.append(-band + np.sqrt((expected[-1] - band) ** 2 + 4 * band * length))
    np.testing.assert_allclose(points, expected, rtol=0, atol=1e-10)


def test_one_element_is_jenkins_contact():
    x = 1e-4 * np.cumsum(np.sin(np.arange(200) ** 1.5))
    one, jenkins = MaxwellSlip((1e4,), (0.1,)), Jenkins(0.1, 1e4)
    np.testing.assert_array_equal(forces_along(one, x, jnp.zeros(1)), forces_along(jenkins, x, jnp.zeros(1)))


def test_a_closed_loop_obeys_masing():
    stiffnesses, limits = elements(5, 0.3)
    law = MaxwellSlip(tuple(stiffnesses), tuple(limits))

    def virgin(s: np.ndarray) -> np.ndarray:
        return np.minimum(stiffnesses[:, None] * s, limits[:, None]).sum(axis=0)

    reach, steps = 6e-6, np.linspace(0, 1, 101)
    outwards, back = reach * steps, reach * (1 - 2 * steps)
    inner = np.concatenate([back[:41], back[40] + 2e-6 * steps, back[40] + 2e-6 * (1 - steps), back[40:]])
    force = forces_along(law, np.concatenate([outwards, inner]), jnp.zeros(5))
    np.testing.assert_allclose(force[:100], virgin(outwards[1:]), rtol=1e-12)
    # Each branch is the virgin curve at twice its size, and the inner loop has no effect afterwards.
    np.testing.assert_allclose(force[101:141], virgin(np.full(1, reach)) - 2 * virgin(reach * steps[1:41]), atol=1e-9)
    np.testing.assert_allclose(force[-61:], virgin(np.full(1, reach)) - 2 * virgin(reach * steps[40:]), atol=1e-9)


def test_steps_may_be_of_any_length_between_two_reversals():
    law = MaxwellSlip(*map(tuple, elements(4, 0.1)))
    fine, coarse = np.linspace(0, 3e-5, 301), np.array([0.0, 3e-5])
    back = np.linspace(3e-5, -2e-5, 401)
    dense = forces_along(law, np.concatenate([fine, back[1:]]), jnp.zeros(4))
    few = forces_along(law, np.concatenate([coarse, back[-1:]]), jnp.zeros(4))
    np.testing.assert_allclose(few, dense[[299, -1]], rtol=1e-12)


@pytest.mark.slow
def test_a_fit_finds_stiffnesses_and_limits():
    truth = {"limits_0": 0.004, "limits_1": 0.006, "stiffnesses_0": 400.0, "stiffnesses_1": 60.0}
    limits, stiffnesses = np.array([0.004, 0.006]), np.array([400.0, 60.0])
    ts = np.arange(0, 0.3, 2e-4)
    x = maxwell_slip(ts, 2e-3, **RIG, stiffnesses=stiffnesses, forces=1.89 * limits)
    noise = 1e-9 * np.random.default_rng(3).normal(size=ts.size)
    start = MaxwellSlip(tuple(1.05 * stiffnesses), tuple(limits * [1.05, 0.95]))
    fit = fj.fit(fj.Trace(ts, x + noise, 1e-9), Oscillator(M, K, C, 1.89, start), free=list(truth), start="release")
    assert fit.converged
    # The order of the elements is arbitrary, and rounding may exchange them during the fit.
    first = 0 if fit.values["stiffnesses_0"] > fit.values["stiffnesses_1"] else 1
    for name, value in truth.items():
        kind, number = name.split("_")
        own = f"{kind}_{int(number) ^ first}"
        assert abs(fit.values[own] - value) < 4 * fit.std_errors[own]
        assert fit.std_errors[own] < 5e-3 * value


@pytest.mark.parametrize(
    ("build", "sentence"),
    [
        (lambda: MaxwellSlip((1e4, -1.0), (0.1, 0.1)), "stiffnesses_1 of MaxwellSlip must be a positive number of N/m"),
        (lambda: MaxwellSlip((1e4,), (0.0,)), "limits_0 of MaxwellSlip must be a positive number, got 0.0."),
        (lambda: MaxwellSlip((1e4,), (0.1, 0.1)), "one limit for each stiffness, .* got 1 stiffnesses and 2 limits."),
        (lambda: MaxwellSlip((), ()), "at least one of both"),
        (lambda: Jenkins(0.0), "mu of Jenkins must be a positive number, got 0.0."),
        (lambda: Jenkins(0.1, np.nan), "sigma0 of Jenkins must be a positive number of N/m, got nan."),
    ],
)
def test_refusals(build, sentence: str):
    with pytest.raises(ValueError, match=sentence):
        build()
