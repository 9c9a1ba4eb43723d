"""Stages of growing windows, and correction of the number of half-cycles."""

import numpy as np
import pytest

from fricjax import Oscillator, fit
from fricjax.fitting import rest
from fricjax.fitting.solve import solve
from fricjax.friction import Coulomb
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.machines import MACHINE, STIFFNESS, coulomb_run

OSCILLATOR = Oscillator(PROTOTYPE_MASS, STIFFNESS, PROTOTYPE_DAMPING, 9.66, Coulomb(0.05))
LONG = coulomb_run(mu=0.005)
"""Ten half-cycles, and in motion at the end."""


@pytest.mark.parametrize("off", [1.1, 0.85])
def test_a_start_that_loses_the_phase_gets_there_by_one_window(off):
    # A plain record needs no start values, but an engine by name does.
    at_once = fit(LONG, OSCILLATOR, MACHINE, engine="exact")
    found = fit(LONG, OSCILLATOR, MACHINE, guess={"stiffness": off * STIFFNESS}, engine="exact")
    assert at_once.stages == 1 and found.stages == 2
    assert found.converged and found.chi2 == pytest.approx(at_once.chi2, abs=1e-6)
    for name in MACHINE:
        assert abs(found.values[name] - at_once.values[name]) < 1e-2 * at_once.std_errors[name]


@pytest.mark.parametrize("more", [1, -1])
def test_a_number_of_half_cycles_that_misses_is_corrected_by_one_more_fit(monkeypatch, more):
    problem = problem_of(coulomb_run(), OSCILLATOR, MACHINE)
    right = int(problem.residual.runs[0].half_cycles)
    counts = []

    def counted(rival, y=None):
        counts.append(int(rival.residual.runs[0].half_cycles))
        return solve(rival, y)

    monkeypatch.setattr(rest, "solve", counted)
    ended, solution = rest.solve_with_rest(rest.with_counts(problem, (right + more,)))
    assert counts == [right + more, right] and int(ended.residual.runs[0].half_cycles) == right
    np.testing.assert_allclose(solution.y, solve(problem).y, atol=1e-9)
