"""Fits as files, as plain data and as reports."""

import dataclasses
import json

import jax.numpy as jnp
import numpy as np
import pytest

from fricjax import Fit, Oscillator, Record, Trace, fit, load_fit, simulate
from fricjax.errors import DataError, UsageError
from fricjax.fitting.warnings import warnings_of_model
from fricjax.friction import Coulomb
from fricjax.oscillator import Exact, Hybrid, Smooth
from fricjax.oscillator.engines.hybrid import Span
from tests.fitting.problem_of import problem_of
from tests.helpers import PROTOTYPE_DAMPING, PROTOTYPE_MASS, largest
from tests.machines import MACHINE, coulomb_run

LOAD = 9.66


@pytest.fixture(scope="module")
def run() -> Trace:
    return coulomb_run()


@pytest.fixture(scope="module")
def found(run) -> Fit:
    machine = Oscillator(PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, LOAD, Coulomb(0.05))
    return fit(run, machine, MACHINE, bounds={"damping": (0.3, None)}, sigma_mode="scale")


@pytest.fixture(scope="module")
def saved(found, tmp_path_factory):
    return found.save(tmp_path_factory.mktemp("fits") / "fit.json")


def strict(path):
    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    return json.loads(path.read_text(encoding="utf-8"), parse_constant=refuse)


def test_the_file_is_strict_json_with_a_schema(saved, found):
    content = strict(saved)
    assert content["schema"] == "fricjax.fit/8"
    assert content["values"]["mu"] == found.values["mu"]
    assert content["std_errors"]["damping"] == "inf"
    assert not list(saved.parent.glob(".*"))


def test_a_fit_comes_back_as_it_was(saved, found, run):
    back = load_fit(saved)
    for name in ("names", "values", "std_errors", "combined_std_errors", "intervals", "units", "flags", "status"):
        assert getattr(back, name) == getattr(found, name), name
    for name in ("converged", "warnings", "chi2", "dof", "sigma", "sigma_mode", "whiteness", "margins", "half_cycles"):
        assert getattr(back, name) == getattr(found, name), name
    for name in ("iterations", "passes", "engine", "aicc", "bic", "quantity", "origins", "kinematics", "contributions"):
        assert getattr(back, name) == getattr(found, name), name
    assert back.engine_used == found.engine_used
    assert back.numerical_shift == found.numerical_shift
    assert np.array_equal(back.covariance, found.covariance)
    assert np.array_equal(back.combined_covariance, found.combined_covariance)
    assert np.array_equal(back.residuals, found.residuals, equal_nan=True)
    assert np.array_equal(back.times[0], found.times[0])
    assert back.chi2_reduced == found.chi2_reduced
    assert back.summary() == found.summary()


def test_a_loaded_fit_predicts(saved, found, run):
    ts = np.asarray(run.t)[250:1500:7] + 3e-5
    assert np.array_equal(load_fit(saved).predict(ts), found.predict(ts))


def test_plain_data_without_the_samples(found):
    content = found.to_dict()
    text = json.dumps(content, allow_nan=False)
    assert len(text) < 10_000 and "residuals" not in content and "residual_rms" in content
    assert content["chi2_reduced"] == found.chi2_reduced
    assert content["numerical_shift"] == found.numerical_shift
    assert content["kinematics"]["natural_frequency"]["unit"] == "Hz"
    assert content["oscillator"]["friction"]["type"] == "Coulomb"


@pytest.mark.parametrize(
    "engine",
    [
        Exact(16),
        Hybrid(nodes=16, span=Span(*map(jnp.asarray, (1e-5, 2e-3, 0.05))), skew=jnp.asarray(0.2)),
        Smooth(jnp.asarray(1e-10), still=jnp.asarray(1e-12)),
    ],
    ids=lambda engine: type(engine).__name__,
)
def test_the_engine_of_a_fit_comes_back_as_it_was(found, tmp_path, engine):
    back = load_fit(dataclasses.replace(found, engine_used=engine).save(tmp_path / "fit.json"))
    assert back.engine_used == engine


def test_what_is_no_solver_is_no_method_of_an_engine(found, tmp_path):
    path = dataclasses.replace(found, engine_used=Smooth(1e-10)).save(tmp_path / "fit.json")
    content = json.loads(path.read_text())
    content["samples"]["engine_used"]["method"] = content["oscillator"]["restoring"]
    path.write_text(json.dumps(content))
    with pytest.raises(DataError, match=r"is no Smooth \(method must be an adaptive solver .* got a Linear\)"):
        load_fit(path)


def test_a_numerical_error_that_shows_is_warned_of(found):
    problem = problem_of(coulomb_run(), found.oscillator, MACHINE)
    sentences = [
        list(warnings_of_model(problem, found.values, found.margins, (None,), None, shift)) for shift in (0.09, 0.32)
    ]
    assert not any("numerical error" in sentence for sentence in sentences[0])
    assert any("may move a parameter by 0.32 standard errors. Ask the engine" in sentence for sentence in sentences[1])


def test_a_fit_that_is_not_finite_claims_no_numerical_accuracy(found):
    assert "numerics" not in dataclasses.replace(found, numerical_shift=np.nan).summary()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("no json", r"fit\.json is not a JSON file: .* Write fits with fit\.save\(\)\."),
        ("[1, 2]", r"fit\.json holds no fit of schema fricjax\.fit/8 but 'list'\. Write it again with fit\.save\(\)\."),
        ('{"schema": "fricjax.fit/1"}', r"holds no fit of schema fricjax\.fit/8 but 'fricjax\.fit/1'\. Write it again"),
        ('{"schema": "fricjax.fit/9"}', r"holds no fit of schema fricjax\.fit/8 but 'fricjax\.fit/9'"),
        (
            '{"schema": "fricjax.fit/8"}',
            r"fit\.json does not hold names, values, .*: only files written by fit",
        ),
    ],
)
def test_other_files_are_refused(tmp_path, content, sentence):
    path = tmp_path / "fit.json"
    path.write_text(content)
    with pytest.raises(DataError, match=sentence):
        load_fit(path)


def test_a_law_of_the_users_own_cannot_be_loaded(saved, tmp_path):
    path = tmp_path / "fit.json"
    path.write_text(saved.read_text().replace('"type": "Coulomb"', '"type": "Mine"'))
    with pytest.raises(DataError, match=r"The fit holds a Mine, which fricjax does not know"):
        load_fit(path)


def test_a_missing_file(tmp_path):
    with pytest.raises(DataError, match=r"There is no file .*absent\.json\. Check the path\."):
        load_fit(tmp_path / "absent.json")


def test_a_fit_goes_only_where_it_may_and_where_there_is_space(found, tmp_path):
    path = found.save(tmp_path / "fit.json")
    before = path.read_bytes()
    with pytest.raises(FileExistsError, match="give overwrite=True"):
        found.save(path)
    with largest(50), pytest.raises(OSError, match="no space left"):
        found.save(path, overwrite=True)
    assert [each.read_bytes() for each in tmp_path.iterdir()] == [before]
    assert found.save(path, overwrite=True) == path


def test_a_save_that_fails_leaves_nothing(found, tmp_path):
    with pytest.raises(OSError):
        found.save(tmp_path / "no such folder" / "fit.json")
    (tmp_path / "taken").mkdir()
    with pytest.raises(OSError):
        found.save(tmp_path / "taken")
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


@pytest.mark.parametrize("part", [np.inf, -np.inf, np.nan])
def test_a_part_of_the_uncertainty_that_is_not_finite_has_no_share(found, part):
    odd = dataclasses.replace(found, contributions={**found.contributions, "mu": {"mass": part}})
    assert "rig inputs:  mu:" not in odd.summary()
    even = dataclasses.replace(
        found, contributions={**found.contributions, "mu": {"mass": 10 * found.std_errors["mu"]}}
    )
    assert "rig inputs:  mu: mass 99 % of the variance" in even.summary()


def test_the_summary_says_what_a_reader_needs(found):
    text = found.summary()
    assert found.status.startswith("does not describe: damping beyond its bound would (") and not found.described
    for line in (
        "Parameter",
        "natural frequency",
        "at bound",
        f"status:      {found.status}",
        "Coulomb friction, linear restoring force, tables engine",
        "4 to the stop; margin to one more",
        "mu_s:        between [",
        "mode scale",
        f"numerics:    numerical error at most {found.numerical_shift:.2g} standard errors",
    ):
        assert line in text, line
    assert repr(found).startswith("Fit(mu=0.0")


def test_the_html_report_holds_the_same(found):
    page = found._repr_html_()
    assert page.count("<table") == 3
    for part in ("stiffness", "at bound", "damping beyond its bound", "dead band", "numerical error at most"):
        assert part in page, part


def test_the_plot_shows_trace_model_and_residuals(found, run):
    drawing = found.plot()
    top, bottom = drawing.axes
    labels = [line.get_label() for line in top.get_lines()]
    assert {"measured", "model"} <= set(labels)
    assert "mm" in top.get_ylabel() and "Residual" in bottom.get_ylabel() and "Time" in bottom.get_xlabel()
    model = top.get_lines()[labels.index("model")]
    drawn = np.isfinite(model.get_ydata())
    assert np.array_equal(drawn, np.isfinite(found.residuals))
    expected = 1e3 * found.predict(np.asarray(model.get_xdata())[drawn])
    assert np.asarray(model.get_ydata())[drawn] == pytest.approx(expected, abs=1e-9)
    curves = [np.asarray(line.get_ydata()) for line in bottom.get_lines()]
    shown = next(curve for curve in curves if curve.size == found.residuals.size)
    assert np.corrcoef(shown[drawn], found.residuals[drawn])[0, 1] == pytest.approx(1)


def test_a_run_that_is_not_there_is_refused(found):
    for call in (lambda: found.predict([0.1], run=1), lambda: found.plot(-1)):
        with pytest.raises(UsageError, match=r"There is no run -?1: this fit has 1, counted from 0"):
            call()


def test_the_fitted_machine_is_simulated_by_the_fastest_engine(found):
    assert simulate(found.oscillator, 1e-3, np.linspace(0, 0.1, 11)).engine == "exact"


def test_a_rotary_rig_has_rotary_units(run):
    machine = Oscillator(PROTOTYPE_MASS, 2574.0, PROTOTYPE_DAMPING, LOAD, Coulomb(0.05))
    units = fit(Record(run, {"quantity": "rad"}), machine, MACHINE).units
    assert [units[name] for name in (*MACHINE, "x0")] == ["", "N m s/rad", "N m/rad", "rad"]
