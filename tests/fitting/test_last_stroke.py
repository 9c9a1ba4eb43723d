"""Records that end in a last stroke from near the dead band."""

import numpy as np
import pytest

from fricjax import Oscillator, fit, fit_batch, synthetic_run
from fricjax.fitting import solve
from fricjax.fitting.residual import motion
from fricjax.fitting.rest import stops_within
from fricjax.friction import Coulomb, Stribeck, Tanh
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import STIFFNESS, coulomb_run

TRUTH = {"mu": 0.02, "mu_s": 0.026, "v_stribeck": 5e-3, "stiffness": STIFFNESS}


def machine(v_stribeck: float) -> Oscillator:
    law = Stribeck(TRUTH["mu"], TRUTH["mu_s"], v_stribeck)
    return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, law)


@pytest.mark.slow
@pytest.mark.parametrize("duration", [0.44, 0.455, 0.48])
def test_the_last_stroke_needs_no_stop(duration: float):
    """End the record during or after the last stroke.

    The stroke begins at 0.437 s, at 1.55 times the static dead band. The mass comes to rest at 0.477 s.
    """
    run = synthetic_run(machine(TRUTH["v_stribeck"]), 1.9e-3, rate=2500.0, duration=duration, noise=5e-9, seed=1)
    found = fit(run, machine(4e-3), list(TRUTH))
    assert found.converged and 0.8 < found.chi2_reduced < 1.2
    assert found.numerical_shift < 0.1
    for name, true in TRUTH.items():
        assert abs(found.values[name] - true) < 4 * found.std_errors[name], name


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.slow
@pytest.mark.parametrize("v_s", [1e-3, 1e-4])
def test_a_law_that_creeps_is_fitted_wherever_its_record_ends(v_s: float):
    """Fit runs of a creeping law with two velocity scales.

    At 1e-3 m/s, slow strokes continue within the dead band. At 1e-4 m/s, the last creep may look like a reversal.
    """
    random = np.random.default_rng(2)
    mu, starts = random.uniform(0.005, 0.02, 24), random.uniform(0.5e-3, 3e-3, 24)

    def of(coefficient: float) -> Oscillator:
        return Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 1.89, Tanh(coefficient, v_s))

    how = {"rate": 5e3, "duration": 2.0, "noise": 5e-9}
    runs = [synthetic_run(of(m), x0, seed=i, **how) for i, (m, x0) in enumerate(zip(mu, starts, strict=True))]
    found = fit_batch(runs, of(0.01), ["mu", "damping", "stiffness"])
    assert found.status == ("described",) * 24
    assert np.all(np.abs(found.values["mu"] - mu) < 4 * found.std_errors["mu"])


@pytest.mark.slow
@pytest.mark.parametrize("start", ["first_reversal", "release"])
@pytest.mark.parametrize("engine", ["exact", "hybrid"])
def test_the_stop_by_the_law_is_read_off_the_turning_points(engine: str, start: str):
    """Compare the stop with the motion under the law alone.

    The package computes this motion only if it continues behind the stop of the record.
    """
    model = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.05))
    problem = problem_of(coulomb_run(), model, ("mu", "stiffness"), engine=engine, start=start)
    residual, seen = problem.residual, set()
    recorded = int(residual.runs[0].half_cycles)
    solution = solve.solve(problem)
    # Up to a friction that holds the mass at its start.
    for mu in np.geomspace(0.02, 1.0, 100):
        y = solution.y.copy()
        y[0] = problem.residual.space.coordinates(np.array([mu, *solution.derived.values[1:]]))[0]
        looked = solve.evaluate_at(problem, solve.checking(residual, y), y)
        at = residual.run_parameters(looked.derived.values, 0)
        count = int(motion(residual.engine, looked.derived.machine, at, np.zeros(1), None).n_half_cycles)
        within = stops_within(problem, solution._replace(evaluation=looked.evaluation, derived=looked.derived), 0)
        expected = recorded if count == 0 else count if count <= recorded else None
        assert within == expected, (mu, count)
        seen.add(expected)
    assert {None, recorded} < seen and len(seen) > 3


@pytest.mark.slow
def test_the_last_turning_points_stand_behind_those_from_the_table():
    """Compare the margins of a long run with the exact engine."""
    run = coulomb_run(2e-3, mu=0.02, samples=4000)
    model = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.02))
    exact, hybrid = (fit(run, model, ["mu", "stiffness"], engine=engine) for engine in ("exact", "hybrid"))
    assert exact.half_cycles == hybrid.half_cycles and (exact.half_cycles[0] or 0) > 8
    assert hybrid.margins[0] == pytest.approx(exact.margins[0], abs=1e-9)
