"""Notebooks run, find their true values, and agree with their py:percent source."""

import re
from pathlib import Path

import jupytext
import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "notebooks"
NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))

# Assertions on the results of each notebook, run as a cell behind its last one.
FOUND = {
    "01_first_fit": """
        assert abs(fit.values["mu"] / 0.05 - 1) < 1e-5
        assert abs(fit.combined_std_errors["mu"] / fit.values["mu"] / 0.005 - 1) < 1e-2
        low, high = fit.intervals["mu_s"]
        assert low <= 0.065 < high
        assert fit.converged and not naive.described and off > 5e-4
    """,
    "02_own_pendulum": """
        assert abs(fit.values["mu"] - 0.12) < 4 * fit.std_errors["mu"] < 4 * 0.01 * 0.12
        assert fit.converged and not linear.described
        assert "a spring that softens with deflection and quadratic drag would" in linear.status
        assert abs(torque.value - 6e-3) < 4 * torque.std
    """,
    "03_routes": """
        assert agreement.agree and not agreement.failures and not doubtful.agree
        assert all(abs(route.mu.value - 0.05) < 4 * route.mu.std for route in agreement.routes)
        assert low < 0.0665 < high and high - low < 0.01
        assert abs(force_map.mu.value - 0.05) < 1e-5
    """,
    "04_choosing_a_law": """
        assert comparison.ranking == ("Stribeck", "Coulomb") and second.ranking == ("LuGre", "Stribeck")
        for name, true in {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 10e-3}.items():
            assert abs(best.values[name] - true) < 4 * best.std_errors[name] < 1e-3 * true
        assert abs(second.best.values["sigma0"] - 2e5) < 4 * second.best.std_errors["sigma0"]
        assert any(text.startswith("Falling friction") for text in comparison.fingerprints)
    """,
    "05_many_at_once": """
        assert np.all(np.abs(fitted - scattered) < 5 * std) and np.all(std < 1e-6)
        assert batch.converged.tolist() == [True] * n_runs + [False]
        low, high = population.scatter_interval
        assert abs(population.mean - 0.05) < 4 * population.std and low < 0.01 * 0.05 < high
    """,
    "06_archive": """
        assert archive.counts == {"ok": 13, "invalid": 0, "rejected": 3, "failed": 0} == again.counts
        for load, mu in true.items():
            assert abs(populations[load].mean - mu) < 5 * populations[load].std < 5 * 0.005 * mu
        assert len(populations[12.0].outliers) == 1
        assert b"run_93.csv" in page.read_bytes()
    """,
    "07_uncertainty_budget": """
        assert abs(better.value - 0.02) < 4 * better.std < 4 * budget.std
        assert max(better.shares, key=better.shares.get) == "lever"
        for name, std in spread.items():
            assert 0.7 < std / spread["fit"] < 1.4, name
        assert profile.conclusion == "bounded" and posterior.divergences == 0
    """,
    "08_sensitivity_and_design": """
        for name, std in zip(names, jnp.sqrt(jnp.diag(covariance))):
            # Two more nuisances make the errors slightly larger.
            assert 1 <= information.std_errors[name] / std < 2, name
        assert interval[0] < 0.0637 < interval[1] and interval[1] - interval[0] < 0.01
        h = 1e-6 * values[0]
        central = (displacement(values.at[0].add(h)) - displacement(values.at[0].add(-h))) / (2 * h)
        assert jnp.max(jnp.abs(central - slopes[:, 0])) < 1e-6 * jnp.max(jnp.abs(slopes[:, 0]))
    """,
    "09_own_law": """
        assert np.max(np.abs(ours.x - reference.x)) < 1e-10
        for name, true in {"mu": 0.05, "b": 0.05, "v_0": 5e-3}.items():
            assert abs(fit.values[name] - true) < 4 * fit.std_errors[name] < 0.01 * true
    """,
    "10_on_a_gpu": """
        assert x.dtype == np.float64 and x.shape == (count, ts.size)
        assert largest < 1e-12
        # In the largest batch, a run takes less time than a single run.
        assert all(seconds[3] / sizes[3] < seconds[0] for seconds in taken.values())
    """,
}


def text_of(path):
    """Return the source of the first cell and of all text cells."""
    cells = [cell.source for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == "markdown"]
    return cells[0], "\n".join(cells)


def test_every_notebook_is_held_against_the_truth():
    assert [path.stem for path in NOTEBOOKS] == list(FOUND)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_is_its_source(path):
    source = jupytext.read(path.with_suffix(".py"))
    notebook = nbformat.read(path, as_version=4)
    assert [(c.cell_type, c.source) for c in notebook.cells] == [(c.cell_type, c.source) for c in source.cells]
    assert all(not cell.get("outputs") for cell in notebook.cells), "strip the outputs before committing"


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_begins_with_a_question_and_leads_on(path):
    first, text = text_of(path)
    assert re.search(r"^\*\*[^*]+\?[^*]*\*\*$", first, re.MULTILINE), "the question that the notebook answers"
    assert "\n## Next\n" in text
    links = re.findall(r"\]\(([^)#:]+)\)", text)
    assert links and all((FOLDER / link).is_file() for link in links)


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebook_finds_the_truth(path, tmp_path, monkeypatch):
    monkeypatch.setenv("FRICJAX_NOTEBOOKS", "fast")
    monkeypatch.setenv("FRICJAX_PROGRESS", "off")
    notebook = nbformat.read(path, as_version=4)
    body = FOUND[path.stem].replace("\n        ", "\n")
    notebook.cells.append(nbformat.v4.new_code_cell(body))
    elsewhere = {"metadata": {"path": str(tmp_path)}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=elsewhere).execute()

    outputs = [(i, output) for i, cell in enumerate(notebook.cells) for output in cell.get("outputs", [])]
    assert not [output["text"] for _, output in outputs if output.get("name") == "stderr"], "no warnings"
    pictures = [i for i, output in outputs if "image/png" in output.get("data", {})]
    formulas = [i for i, cell in enumerate(notebook.cells) if cell.cell_type == "markdown" and "$" in cell.source]
    assert min(pictures) < min(formulas, default=len(notebook.cells)), "pictures before formulas"
