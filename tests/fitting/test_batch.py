"""Batch fits against single fits, with a separate outcome for each run."""

import numpy as np
import pytest

import fricjax as fj
from fricjax.errors import UsageError
from fricjax.fitting import chunks, mesh
from tests.compilations import compilations
from tests.machines import MACHINE, RIGS, coulomb_run, noisy, oscillator

SLIDING = oscillator(RIGS["sliding"], "Coulomb")
STARTS = (2e-3, 1.6e-3, 2.4e-3, 1.2e-3)


@pytest.fixture(scope="module")
def traces() -> list[fj.Trace]:
    """Runs that come to rest, two of them shorter than the others."""
    long = [coulomb_run(x0, seed=i) for i, x0 in enumerate(STARTS[:2])]
    return long + [coulomb_run(x0, seed=2 + i, samples=1500) for i, x0 in enumerate(STARTS[2:])]


@pytest.fixture(scope="module", params=["one by one", "in chunks"])
def batch(traces: list[fj.Trace], request: pytest.FixtureRequest) -> fj.BatchFit:
    with pytest.MonkeyPatch.context() as patch:
        if request.param == "in chunks":
            patch.setattr(chunks, "WIDTH", 2)
        return fj.fit_batch(traces, SLIDING, MACHINE)


def test_each_run_is_fitted_as_it_would_be_alone(batch: fj.BatchFit, traces: list[fj.Trace]):
    for i, trace in enumerate(traces):
        alone = fj.fit(trace, SLIDING, MACHINE)
        assert batch.status[i] == alone.status == "described"
        for name in batch.names:
            assert batch.values[name][i] == pytest.approx(alone.values[name], abs=1e-2 * alone.std_errors[name])
            assert batch.std_errors[name][i] == pytest.approx(alone.std_errors[name], rel=1e-4)
        assert batch.chi2[i] == pytest.approx(alone.chi2, rel=1e-6)
        assert batch.half_cycles[i] == alone.half_cycles[0]
        assert batch.dof[i] == alone.dof
        assert batch.residual_rms[i] == pytest.approx(alone.residual_rms, rel=1e-3)
        for name, estimate in alone.kinematics.items():
            assert batch.kinematics[name][i] == pytest.approx(estimate.value, rel=1e-6)
            assert batch.kinematics_std[name][i] == pytest.approx(estimate.std, rel=1e-3)


def test_the_truth_lies_within_the_errors(batch: fj.BatchFit):
    pull = (batch.values["mu"] - 0.05) / batch.std_errors["mu"]
    assert np.max(np.abs(pull)) < 4
    assert np.all(batch.numerical_shift < 0.1)


@pytest.mark.usefixtures("small_chunks")
def test_a_bad_run_does_not_stop_the_others(traces: list[fj.Trace]):
    t = np.arange(2000) / 5e3
    still = fj.Trace(t, 1e-9 * np.random.default_rng(0).standard_normal(t.size))
    found = fj.fit_batch([traces[0], still, "run.csv", traces[1]], SLIDING, MACHINE)
    assert [s.split(":")[0] for s in found.status] == ["described", "rejected", "rejected", "described"]
    assert "x is constant" in found.status[1]
    assert "rejected: There is no file run.csv." in found.status[2]
    assert found.sources == ("", "", "run.csv", "")
    assert np.isnan(found.values["mu"][1]) and np.isfinite(found.values["mu"][3])
    np.testing.assert_array_equal(found.converged, [True, False, False, True])
    table = found.to_dataframe()
    assert list(table["status"]) == list(found.status)
    assert table["mu"].isna().tolist() == [False, True, True, False]


@pytest.mark.usefixtures("small_chunks")
def test_a_mass_that_stopped_just_before_its_record_ends():
    """Fit a record without a visible rest.

    A wrong number of half-cycles leaves residuals far below the dead band.
    """
    machine = fj.Oscillator(0.41068, 2574.0, 0.17557, 9.66, fj.friction.Coulomb(0.013441))
    stop = float(np.asarray(fj.simulate(machine, 2.2e-3, np.zeros(1)).t_stop))
    run = fj.synthetic_run(machine, 2.2e-3, rate=4e3, duration=stop + 6e-3, noise=5e-9, seed=1)
    assert run.segmentation.rest is None
    batch = fj.fit_batch([run, run], machine, MACHINE)
    assert batch.status == 2 * ("described",)
    assert abs(batch.values["mu"][0] - 0.013441) < 5 * batch.std_errors["mu"][0]


@pytest.mark.slow
def test_a_run_that_needs_too_many_steps_does_not_stop_the_others(monkeypatch):
    finite, most = mesh._finite, 1500

    def bounded(ends):
        if np.isfinite(np.asarray(ends)).sum() > most:
            raise UsageError("The motion needs more steps.")
        return finite(ends)

    monkeypatch.setattr(mesh, "_finite", bounded)
    runs = [noisy("sliding", "LuGre", 0), noisy("rolling", "LuGre", 0)]
    found = fj.fit_batch(runs, oscillator(RIGS["sliding"], "LuGre"), (*MACHINE, "sigma0"))
    assert found.status == ("described", "rejected: The motion needs more steps.")


def test_settings_that_fit_no_run_are_an_error(traces: list[fj.Trace]):
    with pytest.raises(UsageError, match=r"No run could be fitted\. The first was rejected: .*'mue'"):
        fj.fit_batch(traces, SLIDING, ["mue"])
    with pytest.raises(UsageError, match=r"fit_batch has no setting 'gues'\. Did you mean 'guess'\?"):
        fj.fit_batch(traces, SLIDING, MACHINE, gues={})  # pyright: ignore[reportCallIssue]
    with pytest.raises(UsageError, match="There is no run to fit"):
        fj.fit_batch([], SLIDING, MACHINE)
    with pytest.raises(UsageError, match=r"Start values of mu must be .* one per run \(4\), got shape \(3,\)"):
        fj.fit_batch(traces, SLIDING, MACHINE, guess={"mu": np.ones(3)})


def test_start_values_may_differ_from_run_to_run(batch: fj.BatchFit, traces: list[fj.Trace]):
    guess = {"mu": 0.05 * np.array([0.8, 1.1, 0.9, 1.2]), "stiffness": 2574.0 * 1.0005}
    found = fj.fit_batch(traces, SLIDING, MACHINE, guess=guess)
    for name in batch.names:
        np.testing.assert_allclose(found.values[name], batch.values[name], atol=1e-2 * batch.std_errors[name].max())


@pytest.mark.slow
def test_more_runs_than_one_computation_holds_compile_nothing_new(traces: list[fj.Trace]):
    many = [coulomb_run(2e-3, seed=i) for i in range(chunks.WIDTH + 3)]
    fj.fit_batch(many[: chunks.WIDTH], SLIDING, MACHINE)
    with compilations() as seen:
        found = fj.fit_batch(many, SLIDING, MACHINE)
    assert not seen
    assert found.converged.all()
    assert np.std((found.values["mu"] - 0.05) / found.std_errors["mu"]) == pytest.approx(1, abs=0.4)


def test_a_few_runs_are_fitted_by_the_program_of_a_single_one(traces: list[fj.Trace]):
    fj.fit(traces[0], SLIDING, MACHINE)
    with compilations() as seen:
        found = fj.fit_batch(traces[:3], SLIDING, MACHINE)
    assert not seen and found.converged.all()


@pytest.mark.parametrize("count", [0, 1, 31, 32, 33, 65, 100])
def test_blocks_hold_all_numbers_and_none_of_them_by_itself_where_others_share_one(count: int):
    for parts in (1, 8):
        sizes = list(map(len, chunks.blocks(count, parts)))
        assert [i for block in chunks.blocks(count, parts) for i in block] == list(range(count))
        assert max(sizes, default=0) <= chunks.WIDTH // parts
        assert len(sizes) == count if count < chunks.WIDTH else max(sizes) - min(sizes) <= 1 < min(sizes)


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("law", ["Tanh", "LuGre"])
def test_other_engines(law: str):
    runs = [noisy("sliding", law, seed) for seed in range(2)]
    machine = oscillator(RIGS["sliding"], law)
    free = (*MACHINE, "sigma0") if law == "LuGre" else MACHINE
    found = fj.fit_batch(runs, machine, free)
    for i, run in enumerate(runs):
        alone = fj.fit(run, machine, free)
        assert found.status[i] == alone.status
        assert found.values["mu"][i] == pytest.approx(alone.values["mu"], abs=2e-2 * alone.std_errors["mu"])
    assert found.engine == {"Tanh": "hybrid", "LuGre": "smooth"}[law]


@pytest.mark.slow
@pytest.mark.usefixtures("small_chunks")
def test_outliers_count_for_less_under_a_robust_loss(traces: list[fj.Trace]):
    x = np.array(traces[0].x)
    x[np.random.default_rng(0).choice(x.size, x.size // 50)] += 2e-6
    spoilt = fj.Trace(traces[0].t, x, sigma=traces[0].sigma)
    squares, robust = (fj.fit_batch([spoilt, spoilt], SLIDING, MACHINE, loss=loss) for loss in ("squares", "cauchy"))
    errors = [abs(found.values["mu"][0] - 0.05) for found in (squares, robust)]
    assert errors[1] < 4 * robust.std_errors["mu"][0] < errors[0]
