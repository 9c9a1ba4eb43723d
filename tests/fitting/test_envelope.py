"""Start values of a pendulum from its reversals, against the true coefficients."""

import numpy as np
import pytest
from scipy.special import ellipk

from fricjax.data import Segmentation
from fricjax.fitting.envelope import FEWEST, envelope
from tests.oracles import Machine, slide

OMEGA = 5.5


def decay(times: np.ndarray, points: np.ndarray) -> Segmentation:
    half_period = float(np.median(np.diff(times)))
    return Segmentation(1e-9, 0.0, 0.0, times, points, None, None, times.size, float(np.ptp(points)) / 2, half_period)


def swing(x0: float, f: float, c: float, q: float, duration: float, offset: float = 0.0) -> Segmentation:
    machine = Machine(1.0, c, lambda x: OMEGA**2 * np.sin(x), lambda speed: f, f, q)
    found = slide(machine, x0, 0.0, np.array([0.0, duration]), rtol=1e-10)
    return decay(np.append(0.0, found.times[:-2]) + 0.3, np.append(x0, found.points[:-2]) + offset)


CASES = {
    "dry, small": (0.3, 0.05, 0.0, 0.0, 60.0),
    "damped": (1.5, 0.2, 0.03, 0.0, 40.0),
    "drag": (2.0, 0.1, 0.002, 0.02, 60.0),
    "from the top, fast": (3.1, 0.5, 0.2, 0.03, 20.0),
}


@pytest.mark.parametrize("name", CASES)
def test_coefficients_from_the_reversals(name: str):
    x0, f, c, q, duration = CASES[name]
    found = envelope([swing(x0, f, c, q, duration, offset=0.02)], {}, {"friction": 0.0})
    assert found is not None
    assert found.omega == pytest.approx(OMEGA, rel=1e-4)
    assert found.friction * found.omega**2 == pytest.approx(f, rel=1e-2)
    assert found.damping * found.omega == pytest.approx(c, rel=2e-2, abs=1e-3)
    assert found.drag == pytest.approx(q, rel=2e-2, abs=1e-3)


def test_the_frequency_without_losses_is_that_of_the_elliptic_integral():
    x0 = 2.9
    times = np.arange(12) * 2 * ellipk(np.sin(x0 / 2) ** 2) / OMEGA
    found = envelope([decay(times, x0 * (-1.0) ** np.arange(12))], {}, {"friction": 0.0})
    assert found is not None and found.omega == pytest.approx(OMEGA, rel=1e-9)
    assert abs(found.friction) < 1e-9


def test_what_is_held_is_taken_at_its_word_and_several_records_share_one_machine():
    pair = [swing(2.5, 0.1, 0.05, 0.01, 20.0, offset=0.1), swing(1.2, 0.1, 0.05, 0.01, 20.0, offset=-0.05)]
    found = envelope(pair, {"damping": 0.05, "drag": 0.01}, {"friction": 0.0})
    assert found is not None and found.friction * found.omega**2 == pytest.approx(0.1, rel=2e-3)
    assert found.damping * found.omega == pytest.approx(0.05) and found.drag == pytest.approx(0.01)
    fixed = envelope(pair, {"omega": 5.4}, {"friction": 0.0})
    assert fixed is not None and fixed.omega == 5.4


def test_a_bound_is_kept_and_the_others_make_up_for_it():
    least = {"friction": 0.0, "damping": 0.06, "drag": 0.0}
    found = envelope([swing(1.5, 0.2, 0.03, 0.0, 40.0)], {}, least)
    assert found is not None
    assert found.damping * found.omega == pytest.approx(0.06, rel=1e-6) and found.drag == 0.0
    assert 0 < found.friction * found.omega**2 < 0.2


def test_reversals_that_were_read_wrong_hardly_count():
    clean = swing(2.0, 0.1, 0.02, 0.005, 40.0)
    points = clean.turning_points.copy()
    points[[7, 20, 33]] += (0.3, -0.2, 0.1)
    found = envelope([decay(clean.turning_times, points)], {}, {"friction": 0.0})
    assert found is not None and found.omega == pytest.approx(OMEGA, rel=2e-3)
    assert found.friction * found.omega**2 == pytest.approx(0.1, rel=0.1)


def test_too_few_reversals_tell_nothing():
    few = swing(1.0, 0.2, 0.0, 0.0, 40.0)
    assert envelope([decay(few.turning_times[: FEWEST - 1], few.turning_points[: FEWEST - 1])], {}, {}) is None
    assert envelope([], {}, {}) is None
