"""Figures and numbers of the paper: stops, maps, energies and files."""

import csv
import itertools
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.helpers import FIG_2_V, FIG_2_X, GOLDEN, SAMPLE_TIMES
from tests.tables import check_rows

pytestmark = pytest.mark.slow

COMMAND = Path(__file__).resolve().parents[2] / "experiments" / "paper" / "run.py"
FIGURES = ("figure_2", "figure_3", "figure_4", "figure_6", "figure_7", "figure_9")
STUDIES = (*FIGURES, "releases", "damped_map")
FORCE, STIFFNESS = 0.981, 5000.0
LIMIT = FORCE / STIFFNESS
PRINTED = {"figure_2": -0.139e-3, "figure_3": 0.176e-3}
ENDS = {"figure_2": (-0.1392e-3, 8, 0.355430635053), "figure_3": (0.1772e-3, 3, 0.133286488145)}
# Damping ratio of the prototype, and its dead band at mu = 0.05 and 9.66 N.
PROTOTYPE_DAMPING_RATIO, PROTOTYPE_BAND = 0.0027, 0.05 * 9.66 / 2574.0


def run(*arguments):
    return subprocess.run([sys.executable, str(COMMAND), *arguments], capture_output=True, text=True)


class Output:
    """Folder, numbers and text of the command."""

    def __init__(self, folder, numbers, text):
        self.folder, self.numbers, self.text = folder, numbers, text

    def number(self, study, quantity):
        (found,) = [number for number in self.numbers[study] if number["quantity"] == quantity]
        return found

    def ours(self, study, quantity):
        return self.number(study, quantity)["ours"]

    def columns(self, study):
        with (self.folder / f"{study}.csv").open(newline="") as file:
            heads, *rows = csv.reader(file)
        return dict(zip(heads, zip(*rows, strict=True), strict=True))

    def column(self, study, head):
        return np.array(self.columns(study)[head], dtype=float)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    done = run("--out", str(folder / "out"), "--json", str(folder / "numbers.json"))
    assert done.returncode == 0, done.stderr
    return Output(folder / "out", json.loads((folder / "numbers.json").read_text()), done.stdout)


def test_golden_ends(found):
    final = found.column("releases", "Final displacement [m]")
    np.testing.assert_allclose(final, [case.final for case in GOLDEN], rtol=1e-9)
    np.testing.assert_allclose(
        found.column("releases", "Time of the stop [s]"), [case.t_stop for case in GOLDEN], rtol=1e-9
    )
    assert found.column("releases", "Half-cycles").tolist() == [case.half_cycles for case in GOLDEN]
    assert found.column("releases", "Initial displacement [m]").tolist() == [case.x0 for case in GOLDEN]


@pytest.mark.parametrize("figure", ENDS)
def test_free_vibrations_end_at_the_printed_position(found, figure):
    final, half_cycles, t_stop = ENDS[figure]
    assert found.ours(figure, "final displacement xf") == pytest.approx(final, rel=1e-9)
    assert found.ours(figure, "half-cycles") == half_cycles
    assert found.ours(figure, "time of the stop") == pytest.approx(t_stop, rel=1e-9)
    assert found.ours(figure, "limiting displacement xlim = mu N/k") == pytest.approx(0.1962e-3, rel=1e-9)
    printed = found.number(figure, "final displacement xf")["printed"]
    assert printed == PRINTED[figure]
    assert abs(printed - final) < 1.5e-6


def test_samples_of_figure_2(found):
    t = found.column("figure_2", "Time [s]")
    rows = [int(np.argmin(np.abs(t - time))) for time in SAMPLE_TIMES]
    np.testing.assert_allclose(t[rows], SAMPLE_TIMES, rtol=1e-12)
    np.testing.assert_allclose(found.column("figure_2", "Displacement [m]")[rows], FIG_2_X, rtol=0, atol=1e-14)
    np.testing.assert_allclose(found.column("figure_2", "Velocity [m/s]")[rows], FIG_2_V, rtol=0, atol=1e-12)


def test_period_and_amplitude_of_the_map(found):
    for which in ("largest", "smallest"):
        period = found.ours("figure_4", f"period 4 mu N/k, {which} peak distance")
        assert period == pytest.approx(4 * LIMIT, rel=1e-9)
        assert found.ours("figure_4", f"amplitude xlim, {which} peak") == pytest.approx(LIMIT, rel=1e-9)
    assert found.ours("figure_4", "first peak") == pytest.approx(LIMIT, rel=1e-9)


def test_the_map_is_a_triangle_wave(found):
    x0 = found.column("figure_4", "Initial displacement [m]")
    wave = LIMIT * 2 / np.pi * np.arcsin(np.sin(np.pi * x0 / (2 * LIMIT)))
    # arcsin loses half the digits at the peaks.
    np.testing.assert_allclose(found.column("figure_4", "Final displacement [m]"), wave, rtol=0, atol=1e-7 * LIMIT)


def test_edges_widths_slopes_and_jumps(found):
    table = {head: np.array(values, float) for head, values in found.columns("damped_map").items()}

    def check(zeta, ratio):
        chosen = (table["Damping ratio"] == zeta) & (table["mu_s/mu"] == ratio)
        n = table["Half-cycles"][chosen]
        assert n.tolist() == list(range(1, n.size + 1))
        assert n.size >= 3
        rho, static = np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), ratio * LIMIT
        width = rho**-n * ((1 + rho) * LIMIT + (1 - rho) * static)
        np.testing.assert_allclose(table["Edge [m]"][chosen], static + np.cumsum(width) - width, rtol=1e-7)
        np.testing.assert_allclose(table["Width [m]"][chosen], width, rtol=1e-7)
        np.testing.assert_allclose(table["Slope"][chosen], (-rho) ** n, rtol=1e-7)
        np.testing.assert_allclose(
            table["Jump [m]"][chosen], (1 + rho) * (static - LIMIT), rtol=1e-7, atol=1e-7 * LIMIT
        )
        amplitude = found.ours("damped_map", f"damping {zeta:.0%}, mu_s/mu {ratio:g}: amplitude")
        assert amplitude == pytest.approx(static, rel=1e-9)

    check_rows(check, itertools.product([0.0, 0.01, 0.1], [1.0, 1.3, 2.5]))


def test_synthetic_trials_spread_by_the_scatter_of_mu(found):
    x0, final, mu = (
        found.column("figure_6", head)
        for head in ("Effective initial displacement [m]", "Final displacement [m]", "Coefficient of friction")
    )
    assert found.column("figure_6", "Trial").tolist() == [1] * 31 + [2] * 31 + [3] * 31
    assert np.std(mu / 0.05 - 1) == pytest.approx(0.02, rel=0.25)
    band = mu * 9.66 / 2574.0
    rho = np.exp(-np.pi * PROTOTYPE_DAMPING_RATIO / np.sqrt(1 - PROTOTYPE_DAMPING_RATIO**2))
    amplitude, sign = x0.copy(), np.ones(x0.size)
    while np.any(moving := amplitude > band):
        amplitude, sign = (
            np.where(moving, rho * amplitude - (1 + rho) * band, amplitude),
            np.where(moving, -sign, sign),
        )
    np.testing.assert_allclose(final, sign * amplitude, rtol=0, atol=1e-15)
    expected = np.hypot(3e-6, 4 * 0.02 * PROTOTYPE_BAND)
    for trial in (1, 2, 3):
        assert found.ours("figure_6", f"mu of trial {trial} by route 2") == pytest.approx(0.05, rel=0.015)
    assert found.ours("figure_6", "spread of xf after two half-cycles") == pytest.approx(expected, rel=0.25)


def test_rolling_contact_stops_and_the_flexure_alone_does_not(found):
    t, free, rolling = (
        found.column("figure_7", head) for head in ("Time [s]", "No contact [m]", "Rolling contact [m]")
    )
    case = next(case for case in GOLDEN if case.name == "rolling 0.005")
    np.testing.assert_allclose(rolling[t > case.t_stop], case.final, rtol=1e-9)
    decay, zeta = 2 * np.pi * 12.6 * PROTOTYPE_DAMPING_RATIO, PROTOTYPE_DAMPING_RATIO
    phase = 2 * np.pi * 12.6 * np.sqrt(1 - zeta**2) * t
    swing = 2e-3 * np.exp(-decay * t) * (np.cos(phase) + zeta / np.sqrt(1 - zeta**2) * np.sin(phase))
    np.testing.assert_allclose(free, swing, rtol=0, atol=1e-13)


def test_energies_of_figure_9(found):
    final = found.ours("figure_9", "friction and damping: final displacement")
    assert final == pytest.approx(-5.026229793856e-05, rel=1e-9)
    assert found.ours("figure_9", "friction: final displacement") == pytest.approx(-0.1392e-3, rel=1e-9)
    energy = {head: found.column("figure_9", head) for head in found.columns("figure_9") if head.startswith("Energy")}
    np.testing.assert_allclose(energy["Energy, none [J]"], 0.0225, rtol=1e-12)
    assert energy["Energy, friction [J]"][-1] == pytest.approx(STIFFNESS * 0.1392e-3**2 / 2, rel=1e-9)
    assert energy["Energy, friction and damping [J]"][-1] == pytest.approx(STIFFNESS * final**2 / 2, rel=1e-9)
    assert found.ours("figure_9", "friction: largest loss rate") == pytest.approx(0.1945, abs=0.5e-4)
    assert found.ours("figure_9", "damping: largest loss rate") == pytest.approx(0.4735, abs=0.5e-4)
    lost = found.ours("figure_9", "friction and damping: loss rate over all time")
    assert lost == pytest.approx(0.0225 - STIFFNESS * final**2 / 2, rel=1e-7)


def test_friction_energy_rate_is_the_friction_force_times_speed(found):
    speed = np.abs(found.column("figure_9", "Velocity, friction and damping [m/s]"))
    rate = found.column("figure_9", "FER [W]")
    np.testing.assert_allclose(rate[speed > 0.01], FORCE * speed[speed > 0.01], rtol=1e-3)
    assert found.ours("figure_9", "friction force as FER over speed") == pytest.approx(FORCE, rel=1e-5)


def test_every_closed_form_is_met(found):
    """Compare all quantities without statistics or maxima of samples."""
    loose = ("spread", "by route 2", "largest loss rate", "over all time", "FER over speed")
    numbers = [n for rows in found.numbers.values() for n in rows if not any(word in n["quantity"] for word in loose)]
    assert len(numbers) > 90
    for n in numbers:
        assert n["ours"] == pytest.approx(n["reference"], rel=1e-9, abs=1e-15), n["quantity"]


def test_each_study_leaves_a_picture_a_table_and_a_section(found):
    page = (found.folder / "paper.md").read_text()

    def check(study):
        assert (found.folder / f"{study}.png").read_bytes().startswith(b"\x89PNG")
        assert (found.folder / f"{study}.png").stat().st_size > 10_000
        columns = found.columns(study)
        columns.pop("Release", None)
        assert np.all(np.isfinite(np.array(list(columns.values()), dtype=float)))
        assert f"({study}.png)" in page
        assert f"({study}.csv)" in page
        for number in found.numbers[study]:
            assert f"| {number['quantity']} |" in page
            assert number["quantity"] in found.text

    check_rows(check, STUDIES)


def test_one_study_alone(tmp_path):
    done = run("--out", str(tmp_path / "new" / "out"), "--only", "figure_3")
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "new" / "out").iterdir()} == {"figure_3.png", "figure_3.csv", "paper.md"}


def test_an_unknown_study_is_refused(tmp_path):
    done = run("--out", str(tmp_path / "out"), "--only", "figure_5")
    assert done.returncode == 2
    assert "No study is called 'figure_5'. Choose from figure_2," in done.stderr
    assert not (tmp_path / "out").exists()
