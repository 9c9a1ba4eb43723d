"""`fricjax budget`: the GUM table of a saved fit and a rig."""

import json

import numpy as np
import pytest

import fricjax as fj
from tests.tables import check_rows
from tests.uncertainty.test_fitted import INPUTS, fitted


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    return fitted(fj.Rig(**INPUTS)).save(tmp_path_factory.mktemp("fits") / "fit.json")


def test_the_table_its_check_and_its_files(fricjax, saved, tmp_path):
    latex, picture = tmp_path / "budget.tex", tmp_path / "budget.png"
    outcome = fricjax("budget", saved, "--latex", latex, "--plot", picture)
    assert outcome.code == 0, outcome.err
    assert "Uncertainty budget of mu" in outcome.out and "1000000 draws" in outcome.out
    first = outcome.out.splitlines()[3]
    assert first.startswith("normal_force") and first.rstrip().endswith("86 %")
    assert latex.read_text().startswith(r"\begin{tabular}") and picture.stat().st_size > 10_000


def test_inputs_factors_and_scatter(fricjax, saved):
    load, arcuate = "normal_force=9.66 +/- 0.0966 rectangular", "arcuate:normal_force=1 +/- 0.02"
    scatter = "0 +/- 0.0005, 9 degrees of freedom"
    words = ("--input", load, "--factor", arcuate, "--scatter", scatter, "--json", "--draws", "0")
    outcome = fricjax("budget", saved, *words)
    assert outcome.code == 0, outcome.out
    found = json.loads(outcome.out)
    expected = [1e-2 / np.sqrt(3), 2e-2, 1e-2, 2e-3]
    assert found["relative"] == pytest.approx(np.linalg.norm(expected), rel=1e-3)
    assert found["contributions"]["arcuate"] == pytest.approx(-2e-2 * found["value"], rel=1e-3)
    # Welch and Satterthwaite: only the scatter has few degrees of freedom.
    assert found["degrees_of_freedom"] == pytest.approx(9 * (np.linalg.norm(expected) / 1e-2) ** 4, rel=1e-2)


REFUSED = [
    (("--input", "load=1"), "'load' is no uncertain input of this fit"),
    (("--factor", "arcuate:load=1(1)"), "'load' is no uncertain input of this fit"),
    (("--factor", "arcuate=1(1)"), "--factor 'arcuate' names no input"),
    (("--level", "95"), "--level must be a probability between 0 and 1"),
    (("--name", "nu"), "This fit has no 'nu'"),
    (("--input", "mass=heavy"), "'heavy' is no number with its uncertainty in SI units"),
    (("--draws", "100"), "100 draws are too few"),
]


def test_wrong_options_are_refused(fricjax, saved):
    def check(words, sentence):
        outcome = fricjax("budget", saved, *words)
        assert outcome.code == 2
        assert sentence in outcome.err

    check_rows(check, REFUSED)


def test_a_file_that_is_no_fit(fricjax, tmp_path):
    assert "There is no file" in fricjax("budget", tmp_path / "no.json").err
    (tmp_path / "run.json").write_text("{}")
    outcome = fricjax("budget", tmp_path / "run.json")
    assert outcome.code == 4 and "holds no fit of schema" in outcome.err
