"""Every law is also integrated by the solvers of diffrax from end to end, and both motions agree."""

import numpy as np
import pytest

from fricjax import Oscillator, simulate
from tests.helpers import LAWS, PROTOTYPE_MASS

TS = np.linspace(0, 0.25, 501)


@pytest.mark.parametrize("name", LAWS)
def test_the_engine_of_a_law_agrees_with_diffrax(name):
    machine = Oscillator(PROTOTYPE_MASS, 2574.0, 0.2, 9.66, LAWS[name].law)
    chosen, reference = (simulate(machine, 2e-3, TS, engine=engine) for engine in ("auto", "diffrax"))
    np.testing.assert_allclose(reference.x, chosen.x, rtol=0, atol=1e-9)
    print(f"{name:28s} {chosen.engine:7s} {np.abs(reference.x - chosen.x).max():.1e} m")
