"""Modal calibration recovers a known mode from its receptance, with correct uncertainties."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fricjax.calibrate.frf import calibrate_frf, read_frf
from fricjax.calibrate.receptance import force_noise, receptance
from fricjax.errors import DataError, UsageError
from fricjax.instrument import ImpactTest, impact_test
from fricjax.rig import Measured

MASS, STIFFNESS, RATIO = 0.41068, 2574.0, 0.0027
DAMPING = 2 * RATIO * math.sqrt(STIFFNESS * MASS)
TRUTH = {
    "mass": MASS,
    "stiffness": STIFFNESS,
    "damping": DAMPING,
    "frequency": math.sqrt(STIFFNESS / MASS) / (2 * math.pi),
    "damping_ratio": RATIO,
}
LINES = 10 + np.arange(401) / 80
BAND = (10.0, 15.0)


def exact(f):
    omega = 2 * np.pi * f
    return 1 / (STIFFNESS - MASS * omega**2 + 1j * DAMPING * omega)


def noisy(seed, relative=0.01):
    generator = np.random.default_rng(seed)
    noise = generator.standard_normal(LINES.size) + 1j * generator.standard_normal(LINES.size)
    return exact(LINES) * (1 + relative * noise / math.sqrt(2))


@pytest.fixture(scope="module")
def long():
    """Calibrate with an impact test of 80 s, with 1 % noise."""
    test = impact_test(MASS, STIFFNESS, DAMPING, duration=80.0, rate=1e4, noise=0.01, seed=1)
    return calibrate_frf(*receptance(test, BAND))


def test_impact_of_eighty_seconds_finds_the_mode(long):
    for name, tolerance in {"frequency": 1e-4, "damping_ratio": 0.03, "damping": 0.03, "stiffness": 0.01}.items():
        assert long.numbers()[name].value == pytest.approx(TRUTH[name], rel=tolerance), name
    assert long.warnings == ()
    assert long.duration == pytest.approx(80.0)


def test_peak_picking_agrees_within_its_own_error(long):
    for name, picked in long.peak_picking.items():
        assert picked.value == pytest.approx(TRUTH[name], rel=0.05), name
    # The force has 0.3 % noise, common to all lines.
    for name in ("frequency", "damping_ratio"):
        assert abs(long.peak_picking[name].value - TRUTH[name]) < 4 * long.peak_picking[name].std


def test_a_record_of_ten_seconds_warns_with_both_numbers():
    test = impact_test(MASS, STIFFNESS, DAMPING, duration=10.0, rate=1e4, noise=0.01)
    f, response = receptance(test, BAND)
    found = calibrate_frf(f, response)
    assert found.warnings[0].startswith("The record of 10 s is too short for this damping, which asks for 73.")
    assert found.warnings[0] in found.summary()
    assert not any("too short" in sentence for sentence in calibrate_frf(f, response, duration=80.0).warnings)


def test_noise_free_lines_give_the_mode_exactly():
    found = calibrate_frf(LINES, exact(LINES))
    for name, number in found.numbers().items():
        assert number.value == pytest.approx(TRUTH[name], rel=1e-10), name


@pytest.mark.slow
def test_standard_uncertainties_are_those_of_repeated_tests():
    found = [calibrate_frf(LINES, noisy(seed)) for seed in range(40)]
    for name, true in TRUTH.items():
        pulls = [(one.numbers()[name].value - true) / one.numbers()[name].std for one in found]
        # 40 pulls scatter by 1 within 11 %.
        assert 0.6 < math.sqrt(np.mean(np.square(pulls))) < 1.4, name


def test_both_kinds_of_noise_are_told_apart():
    generator = np.random.default_rng(0)
    constant = 1e-5 * (generator.standard_normal(LINES.size) + 1j * generator.standard_normal(LINES.size))
    found = calibrate_frf(LINES, noisy(1) + constant / math.sqrt(2))
    assert found.noise == pytest.approx(0.01, rel=0.4)
    quiet = calibrate_frf(LINES, exact(LINES) + constant / math.sqrt(2))
    assert quiet.noise == pytest.approx(1e-5 / np.abs(exact(LINES)).max(), rel=0.2)


def test_residual_compliance_is_separated():
    found = calibrate_frf(LINES, noisy(2) + 5e-5)
    assert abs(found.residual_compliance.value - 5e-5) < 4 * found.residual_compliance.std
    assert abs(found.stiffness.value - STIFFNESS) < 4 * found.stiffness.std


def test_the_scale_of_the_force_sensor_enters_mass_stiffness_and_damping():
    found = calibrate_frf(LINES, noisy(3, 1e-4), scale_std=0.01)
    for name in ("mass", "stiffness", "damping"):
        assert found.numbers()[name].relative == pytest.approx(0.01, rel=1e-2), name
        assert found.peak_picking[name].relative >= 0.01, name
    assert found.frequency.relative < 1e-6
    assert found.damping_ratio.relative < 1e-3
    assert found.peak_picking["frequency"].relative < 1e-4


def test_two_modes_in_the_band_are_noticed():
    second = 0.3 / (STIFFNESS - MASS * (2 * np.pi * (LINES - 0.05)) ** 2 + 1j * DAMPING * 2 * np.pi * LINES)
    found = calibrate_frf(LINES, noisy(4, 1e-3) + second)
    assert any("is not that of one mode" in sentence for sentence in found.warnings)


def test_rig_of_a_calibration():
    found = calibrate_frf(LINES, noisy(5))
    rig = found.rig(normal_force=Measured(9.66, 0.05), drag=0.1)
    assert (rig.mass, rig.frequency, rig.damping_ratio) == (found.mass, found.frequency, found.damping_ratio)
    assert rig.normal_force == Measured(9.66, 0.05)
    assert "12.600" in found._repr_html_()
    assert found.to_dict()["mass"] == {"value": found.mass.value, "std": found.mass.std}


@pytest.mark.parametrize(
    ("frequency", "response", "sentence"),
    [
        (LINES, exact(LINES)[:-1], "frequency and receptance must be equally long rows of at least 8 lines"),
        (LINES[:5], exact(LINES[:5]), "frequency and receptance must be equally long rows of at least 8 lines"),
        (LINES, np.abs(exact(LINES)), "The receptance is real."),
        (LINES[::-1], exact(LINES[::-1]), "frequency must increase from line to line"),
        (LINES, exact(LINES) * np.nan, "frequency and receptance must be finite."),
        (LINES, -exact(LINES), "The imaginary part of the receptance has its minimum at"),
        (
            LINES[:150],
            exact(LINES[:150]),
            "The imaginary part of the receptance has its minimum at 11.8625 Hz, the edge",
        ),
        (["a"] * 9, [1j] * 9, "frequency and receptance must hold numbers"),
    ],
)
def test_refusals_by_their_text(frequency, response, sentence):
    with pytest.raises(DataError) as caught:
        calibrate_frf(frequency, response)
    assert str(caught.value).startswith(sentence)


def test_settings_are_refused_by_their_text():
    with pytest.raises(UsageError, match="duration must be a positive number of s, got 0"):
        calibrate_frf(LINES, exact(LINES), duration=0.0)
    with pytest.raises(UsageError, match="must not be negative, got -1"):
        calibrate_frf(LINES, exact(LINES), scale_std=-1.0)


def test_simulated_impact_is_the_solution_of_the_equation_of_motion():
    damping, pulse, force = 3.0, 5e-3, 10.0

    def rates(t, y):
        drive = force * math.sin(math.pi * t / pulse) if t < pulse else 0.0
        return [y[1], (drive - damping * y[1] - STIFFNESS * y[0]) / MASS]

    test = impact_test(MASS, STIFFNESS, damping, duration=0.1, rate=1e4, peak_force=force, pulse=pulse, noise=0.0)
    found = solve_ivp(rates, (0, 0.1), [0, 0], t_eval=test.t, rtol=1e-10, atol=1e-14, max_step=1e-3)
    np.testing.assert_allclose(test.displacement[0], found.y[0], atol=1e-9)
    assert np.abs(test.displacement).max() > 5e-4


def test_noise_of_the_force_explains_the_scatter_of_the_stiffness():
    pulls = []
    for seed in range(30):
        test = impact_test(MASS, STIFFNESS, 20 * DAMPING, duration=5.0, rate=1e4, noise=0.02, seed=seed)
        found = calibrate_frf(*receptance(test, (5.0, 25.0)), scale_std=force_noise(test))
        pulls.append((found.stiffness.value - STIFFNESS) / found.stiffness.std)
    # 30 pulls scatter by 1 within 13 %.
    assert 0.55 < math.sqrt(np.mean(np.square(pulls))) < 1.45


def test_averaging_blows_lowers_the_noise():
    def error(hits):
        test = impact_test(MASS, STIFFNESS, 20 * DAMPING, duration=4.0, rate=5e3, noise=0.01, hits=hits, seed=3)
        omega = 2 * np.pi * (f := receptance(test, (5.0, 30.0)))[0]
        return np.std(f[1] * (STIFFNESS - MASS * omega**2 + 20j * DAMPING * omega))

    assert 3 < error(1) / error(25) < 8


def test_a_blow_in_the_middle_of_the_record_is_found():
    test = impact_test(MASS, STIFFNESS, 20 * DAMPING, duration=8.0, rate=2e3, noise=0.0)
    late = ImpactTest(
        test.t, *(np.pad(x, ((0, 0), (400, 0)))[:, : test.t.size] for x in (test.force, test.displacement))
    )
    for early, shifted in zip(receptance(test, BAND), receptance(late, BAND), strict=True):
        np.testing.assert_allclose(shifted, early, rtol=1e-4)


def test_a_band_without_lines_is_refused():
    test = impact_test(MASS, STIFFNESS, DAMPING, duration=1.0, rate=1e3)
    with pytest.raises(DataError, match=r"No line of the spectrum lies between 12.1 and 12.2 Hz; widen the band."):
        receptance(test, (12.1, 12.2))


def test_overcritical_damping_has_no_ringing():
    with pytest.raises(UsageError, match="damping must lie between zero and the critical"):
        impact_test(MASS, STIFFNESS, 100.0, duration=1.0, rate=1e3)


def test_tables_are_read_with_their_units(tmp_path):
    path = tmp_path / "frf.csv"
    rows = [f"{f:.4f};{1e6 * h.real:.6f};{1e6 * h.imag:.6f}" for f, h in zip(LINES, exact(LINES), strict=True)]
    path.write_text("\n".join(["f [Hz];Re [um/N];Im [um/N]", *rows]))
    frequency, response = read_frf(path)
    np.testing.assert_allclose(frequency, LINES, atol=1e-4)
    np.testing.assert_allclose(response, exact(LINES), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("1,2\n2,3\n3,4\n", "frf.csv has 2 column(s); a receptance needs 3"),
        ("f [Hz],Re [m],Im [m]\n1,2,3\n2,3,4\n", "frf.csv: the unit 'm' does not fit the real part of a receptance"),
        ("1,2,3\n2,3,4\n3,x,5\n4,5,6\n", "frf.csv, row 3: '3,x,5' does not hold 3 numbers; repair the row."),
    ],
)
def test_tables_refused_by_their_text(tmp_path, text, sentence):
    (tmp_path / "frf.csv").write_text(text)
    with pytest.raises(DataError) as caught:
        read_frf(tmp_path / "frf.csv")
    assert str(caught.value).startswith(sentence)


def test_a_missing_table_is_named(tmp_path):
    with pytest.raises(DataError, match=r"none.csv' cannot be read: No such file"):
        read_frf(tmp_path / "none.csv")
