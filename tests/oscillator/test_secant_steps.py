"""Steps of the smooth engine to the reversals of a bristle law."""

import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.friction import Dahl
from fricjax.oscillator import Oscillator, simulate
from fricjax.oscillator.engines.smooth import Smooth
from fricjax.oscillator.simulate import starting_state

pytestmark = pytest.mark.slow

MACHINE = Oscillator(0.41068, 2574.0, 0.17557, 1.89, Dahl(0.01, 1e5, 1.5))
END = 0.3  # seven strokes of 0.0397 s


def test_steps_end_at_the_reversals():
    trail = Smooth(max_steps=4000).trail(MACHINE, starting_state(MACHINE, 2e-3, 0.0), jnp.asarray(END))
    t, v = np.asarray(trail.t), np.asarray(trail.v)
    crossed = np.flatnonzero(v[:-1] * v[1:] < 0)
    assert crossed.size == 7
    assert np.max(np.diff(t)[crossed]) * np.sqrt(2574.0 / 0.41068) < 2e-8


def test_few_steps_are_refused():
    # The step controller alone would bisect towards each reversal, with more than forty rejected steps.
    motion = simulate(MACHINE, 2e-3, np.array([0.0, END]))
    assert int(motion.stats["num_rejected_steps"]) < 30 * 7
