"""Expected standard errors against published Cramer-Rao bounds, and warnings."""

import numpy as np
import pytest

from fricjax.errors import UsageError
from fricjax.friction import Coulomb, Stribeck
from fricjax.oscillator import Oscillator
from fricjax.sensitivity import fisher
from fricjax.sensitivity.plan import TAIL
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS
from tests.oracles import Machine, slide
from tests.sensitivity.machines import ROLLING, SLIDING, STATE, STIFFNESS, prototype

# Relative standard errors of mu with 1 nm at 10 kHz until 50 ms after the stop: mu alone, with frequency, x0 and
# release time, with the offset, with the damping. Printed with two digits, computed from another program.
SLIDING_BOUNDS = [
    (0.02, 0.25e-3, 2, (1.3e-7, 3.4e-7, 5.6e-7, 1.3e-5)),
    (0.02, 0.50e-3, 3, (8.3e-8, 2.0e-7, 2.2e-7, 9.3e-7)),
    (0.02, 1.00e-3, 6, (3.8e-8, 8.0e-8, 8.3e-8, 3.3e-7)),
    (0.05, 0.25e-3, 1, (1.1e-7, 4.9e-7, np.inf, np.inf)),
    (0.05, 0.50e-3, 1, (1.1e-7, 4.9e-7, np.inf, np.inf)),
    (0.05, 1.00e-3, 3, (3.3e-8, 7.9e-8, 8.7e-8, 2.3e-7)),
    (0.10, 0.50e-3, 1, (5.3e-8, 2.5e-7, np.inf, np.inf)),
    (0.10, 1.00e-3, 1, (5.3e-8, 2.5e-7, np.inf, np.inf)),
    (0.15, 1.00e-3, 1, (3.5e-8, 1.6e-7, np.inf, np.inf)),
    (0.20, 1.00e-3, 1, (2.6e-8, 1.2e-7, np.inf, np.inf)),
]
ROLLING_BOUNDS = [
    (0.001, 298, (3.4e-8, 4.1e-8, 9.1e-8), -0.89),
    (0.002, 226, (2.2e-8, 2.8e-8, 7.2e-8), -0.92),
    (0.005, 141, (1.5e-8, 2.1e-8, 6.3e-8), -0.94),
    (0.010, 91, (1.2e-8, 1.9e-8, 6.2e-8), -0.95),
]
DAMPING = ["mu", "mass", "damping"]
PRINTED = 0.05
"""Half a unit of the second digit, at worst."""


def relative(found):
    return found.std_errors["mu"] / found.values["mu"]


def among(found, names):
    """Relative standard error of mu if only these parameters are free."""
    index = [found.names.index(name) for name in names]
    part = found.matrix[np.ix_(index, index)]
    return np.sqrt(np.linalg.inv(part)[0, 0]) / found.values["mu"]


@pytest.mark.slow
@pytest.mark.parametrize("mu, x0, half_cycles, bounds", SLIDING_BOUNDS)
def test_bounds_of_sliding(mu, x0, half_cycles, bounds):
    found = fisher(prototype(Coulomb(mu)), x0, names=DAMPING, nuisance=STATE)
    assert found.motion.half_cycles == half_cycles
    alone, moving = among(found, ["mu"]), among(found, ["mu", "mass", "x0", "t_release"])
    np.testing.assert_allclose([alone, moving, relative(found)], [bounds[0], bounds[1], bounds[3]], rtol=PRINTED)
    if half_cycles > 1:
        assert among(found, ["mu", "mass", *STATE]) == pytest.approx(bounds[2], rel=PRINTED)
        assert not found.singular
        return
    # A cell without a number: one half-cycle gives only the centre x_d + offset and the release.
    assert found.undetermined == ("mu", "x0", "offset")
    (direction,) = found.singular
    shift = SLIDING * mu / STIFFNESS
    change = dict(zip(direction.names, direction.changes / direction.changes[direction.names.index("mu")], strict=True))
    assert change == pytest.approx({"mu": 1.0, "x0": shift / mu, "offset": -shift / mu}, rel=1e-4)


@pytest.mark.parametrize(("mu", "x0"), [(0.1, 0.25e-3), (0.2, 0.25e-3), (0.2, 0.5e-3)])
def test_cells_without_motion_determine_no_friction(mu, x0):
    found = fisher(prototype(Coulomb(mu)), x0, names=DAMPING, nuisance=STATE, duration=0.05)
    assert found.motion.half_cycles == 0 and found.no_effect == ("mu", "mass", "damping", "t_release")
    assert [direction.text for direction in found.singular] == ["x0 and offset only as a sum"]


def test_a_bound_from_differences_of_an_integration():
    """Compute one bound without the package.

    It is the cell of mu = 0.02 and 0.5 mm, from SciPy's DOP853 at shifted parameters.
    """
    mu, x0, mass, damping = 0.02, 0.5e-3, PROTOTYPE_MASS, PROTOTYPE_DAMPING
    t = np.arange(0.0, 3 * np.pi / np.sqrt(STIFFNESS / mass) + TAIL, 1e-4)

    def reading(mu=mu, mass=mass, damping=damping, x0=x0, release=0.0, offset=0.0):
        force = mu * SLIDING
        oracle = Machine(mass, damping, lambda x: STIFFNESS * x, lambda _: force, force)
        moved = slide(oracle, x0, 0.0, np.maximum(t - release, 0.0))
        return moved.x + offset

    # Shifts that move the trace by about a nanometre. Their differences have a relative error of 1e-4.
    shifts = {"mu": 1e-5 * mu, "mass": 1e-5 * mass, "damping": 1e-3 * damping, "x0": 1e-9, "offset": 1e-9}
    shifts["release"] = 1e-7
    base = {"mu": mu, "mass": mass, "damping": damping, "x0": x0, "release": 0.0, "offset": 0.0}
    columns = [
        (reading(**{**base, name: base[name] + step}) - reading(**{**base, name: base[name] - step})) / (2 * step)
        for name, step in shifts.items()
    ]
    unit = np.linalg.norm(columns, axis=1)
    scaled = (np.array(columns) / unit[:, None]).T
    error = 1e-9 * np.sqrt(np.linalg.inv(scaled.T @ scaled)[0, 0]) / unit[0] / mu
    assert error == pytest.approx(9.3e-7, rel=PRINTED)
    found = fisher(prototype(Coulomb(mu)), x0, names=DAMPING, nuisance=STATE)
    assert error == pytest.approx(relative(found), rel=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("mu, half_cycles, bounds, related", ROLLING_BOUNDS)
def test_bounds_of_rolling(mu, half_cycles, bounds, related):
    found = fisher(prototype(Coulomb(mu), ROLLING), 2e-3, names=DAMPING, nuisance=STATE)
    assert found.motion.half_cycles == half_cycles
    errors = [among(found, ["mu"]), among(found, ["mu", "mass", *STATE]), relative(found)]
    np.testing.assert_allclose(errors, bounds, rtol=PRINTED)
    assert found.correlation_of("mu", "damping") == pytest.approx(related, abs=0.006)
    assert any("prior on damping from a ring-down" in text for text in found.warnings)


def test_the_error_of_one_coefficient_is_that_of_its_column():
    """Compare the error of mu alone with noise/|dx/dmu|.

    In the first half-cycle and without damping, dx/dmu = (1 - cos) N/k.
    """
    machine = prototype(Coulomb(0.05))
    omega = float(machine.angular_frequency)
    ts = np.linspace(0.0, 0.9 * np.pi / omega, 200)
    found = fisher(machine, 1e-3, ts, ["mu"], noise=3e-9, nuisance=())
    column = (1 - np.cos(omega * ts)) * 9.66 / 2574.0
    assert found.std_errors["mu"] == pytest.approx(3e-9 / np.sqrt(column @ column), rel=0.01)
    assert found.samples == 200 and found.rate == pytest.approx(199 / ts[-1])
    assert any("ends before the mass stops" in text for text in found.warnings)


def test_one_half_cycle_tells_only_its_centre():
    found = fisher(prototype(Coulomb(0.1)), 1e-3, names=["mu", "mass"], nuisance=("x0", "offset"))
    assert found.undetermined == ("mu", "x0", "offset")
    # The centre offset + x_d and the release offset + x0 stay: x_d = mu N/k = 375.29 um, of which 1 % is 3.75 um.
    text = "mu, x0 and offset only together: +3.75 um of x0 and -3.75 um of offset go unseen with +1 % of mu"
    assert [direction.text for direction in found.singular] == [text]
    assert "1 half-cycle, and from fewer than 2" in found.warnings[0]
    assert "Release from 2.25 mm to 3.75 mm, 6 to 10 dead bands" in found.warnings[0]


def test_no_motion():
    found = fisher(prototype(Coulomb(0.3)), 1e-3, names=["mu", "mass"], duration=0.2)
    assert found.no_effect == ("mu", "mass") and found.rank == 1
    assert "mu has no effect, for the mass does not move" in found.errors[0]
    assert "static friction holds it" in found.warnings[0]


# D.1: 2 mm, mu = 0.05, mu_s = 0.065, all nuisances free: sd(mu_s), sd(v_stribeck)/v_stribeck, their correlation.
RIDGE = [(1e-3, 1.5e-5, 1.2e-3, -1.000), (5e-3, 6e-7, 5e-5, -0.989), (20e-3, 5e-8, 5e-6, -0.90)]


@pytest.mark.slow
@pytest.mark.parametrize("speed, static, stribeck, related", RIDGE)
def test_the_stribeck_ridge(speed, static, stribeck, related):
    names = ["mu", "mu_s", "v_stribeck", "mass", "damping"]
    found = fisher(prototype(Stribeck(0.05, 0.065, speed)), 2e-3, names=names, nuisance=STATE)
    assert found.std_errors["mu_s"] == pytest.approx(static, rel=0.06)
    assert found.std_errors["v_stribeck"] / speed == pytest.approx(stribeck, rel=0.06)
    assert found.correlation_of("mu_s", "v_stribeck") == pytest.approx(related, abs=2e-3)
    assert 2e-8 < found.std_errors["mu"] < 4e-8
    work = found.combinations["(mu_s - mu) v_stribeck^2"]
    assert work.value == pytest.approx(0.015 * speed**2)
    # The best combination has a smaller error than that with any other power, and than the fall alone.
    best = min(each.std / each.value for each in found.combinations.values())
    assert best <= min(work.std / work.value, found.std_of({"mu_s": 1.0, "mu": -1.0}) / 0.015)
    assert any("mu_s and v_stribeck correlate" in text for text in found.warnings) == (related < -0.95)


def test_a_stop_that_hangs_by_a_hair():
    """Warn about a stop that is uncertain.

    Undamped, a_n = x0 - 2 n x_d. After two half-cycles, a_n is only 2 % of x_d above the static band of 1.3 x_d.
    """
    machine = Oscillator(1.0, 1000.0, 0.0, 10.0, Coulomb(0.05, 0.065))
    found = fisher(machine, 5.32 * 0.5e-3, names=["mu", "mass"], rate=200.0)
    assert found.motion.half_cycles == 3
    assert any("may also stop after 2 half-cycles: 10 um, 2.0% of the dead band" in text for text in found.warnings)
    assert any("only 5.3 dead bands away (3 half-cycles)" in text for text in found.warnings)
    assert any("only 19.9 samples in a half-cycle" in text for text in found.warnings)


@pytest.mark.parametrize(
    "settings, message",
    [
        ({"noise": 0.0}, "The noise must be a positive standard deviation"),
        ({"rate": -1.0}, "The rate must be a positive number"),
        ({"duration": -1.0}, "The duration must be a positive number"),
        ({"nuisance": ("x1",)}, "There is no nuisance parameter 'x1'"),
        ({"names": ["mu", "drag"], "engine": "exact"}, "with respect to drag are not finite under the exact engine"),
        ({"names": ["drag"], "engine": "smooth"}, "smooth engine cannot integrate the jump"),
    ],
)
def test_what_is_refused(settings, message):
    with pytest.raises(UsageError, match=message):
        fisher(prototype(Coulomb(0.05)), 1e-3, **settings)


def test_without_friction_a_duration_is_needed():
    with pytest.raises(UsageError, match="never comes to rest here"):
        fisher(prototype(Coulomb(0.0)), 1e-3)
