"""Data frames of all results hold SI numbers equal to their attributes."""

import importlib
import inspect
import math
import re
from pathlib import Path
from types import SimpleNamespace

import jax
import numpy as np
import pytest

import fricjax as fj
from fricjax.comparison.result import Comparison, Row
from fricjax.energy_loss.agreement import Agreement, Route
from fricjax.pairs.result import Estimates
from fricjax.sensitivity import Curves, NextRelease, OptimalRuns, Outcome, Point, Sobol
from fricjax.show import Reported
from fricjax.uncertainty import (
    Bootstrap,
    Hierarchical,
    Input,
    NoiseModelRow,
    NoiseModels,
    Posterior,
    Profile,
    Sandwich,
    propagate,
)

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]
UNITS = {"mu": "", "damping": "N s/m", "stiffness": "N/m"}
VALUES = {"mu": 0.05, "damping": 0.2, "stiffness": 2500.0}
STDS = {"mu": 1e-7, "damping": 2e-4, "stiffness": 3e-2}
DRAWS = np.array([*VALUES.values()]) + np.random.default_rng(0).normal(size=(2, 200, 3)) * [*STDS.values()]


@pytest.fixture(scope="module")
def given(tmp_path_factory):
    """Return the results that need a simulation or a fit."""
    folder = tmp_path_factory.mktemp("runs")
    runs = [fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=seed) for seed in range(3)]
    paths = [fj.write(run, folder / f"run_{i}.csv") for i, run in enumerate(runs)]
    files = fj.data.example_paths()
    rig = fj.Rig.from_toml(files.rig)
    targets = {"mu": 5e-8, "stiffness": 1e-8}
    return SimpleNamespace(
        runs=runs,
        files=files,
        rig=rig,
        fit=fj.fit(runs[0], MACHINE, FREE),
        batch=fj.fit_batch(runs, MACHINE, FREE),
        design=fj.sensitivity.design(MACHINE, np.linspace(1e-3, 2e-3, 9), targets, names=["mu", "stiffness"]),
        force_map=fj.friction_force_map(files.run, rig),
        archive=fj.batch(paths, folder / "out", MACHINE, FREE),
    )


def table_of(numbers, *names):
    """Return values and standard uncertainties of `Measured` numbers by name."""
    value, std = names or ("value", "std")
    return {
        value: {key: each.value for key, each in numbers.items()},
        std: {key: each.std for key, each in numbers.items()},
    }


def budget(given):
    load = Input(9.66, 0.05, "N", degrees_of_freedom=9)
    inputs = {"k": Input(2574.0, 25.7, "N/m"), "x": Input(1e-4, 1e-8, "m"), "load": load, "one": Input(1.0, 0.0)}
    found = propagate(lambda k, x, load, one: one * k * x / load, inputs, quantity="mu")
    return found, {
        **table_of(inputs),
        "sensitivity": found.sensitivities,
        "contribution": found.contributions,
        "share": found.shares,
        "degrees_of_freedom": {name: each.degrees_of_freedom for name, each in inputs.items()},
    }


def monte_carlo(given):
    found = budget(given)[0].monte_carlo(20_000)
    ends = [found.interval, found.shortest, found.budget_interval]
    numbers = {"value": [found.mean, math.nan, found.value], "std": [found.std, math.nan, found.budget_std]}
    return found, numbers | {"low": [low for low, _ in ends], "high": [high for _, high in ends]}


def posterior(given):
    found = Posterior((*FREE,), UNITS, DRAWS, VALUES, STDS, dict.fromkeys(FREE, 1.001), dict.fromkeys(FREE, 321.5), 0)
    return found, {
        "value": dict(zip(FREE, DRAWS.reshape(-1, 3).mean(axis=0), strict=True)),
        "std": found.std,
        "low": {name: low for name, (low, _) in found.intervals().items()},
        "high": {name: high for name, (_, high) in found.intervals().items()},
        "ratio": {name: std / STDS[name] for name, std in found.std.items()},
        "r_hat": found.r_hat,
        "effective": found.effective,
    }


def bootstrap(given):
    found = Bootstrap((*FREE,), UNITS, DRAWS[0], VALUES, STDS, "blocks", (5,))
    ends = found.intervals()
    return found, {
        "value": VALUES,
        "std": found.std,
        "bias": found.bias,
        "low": {name: low for name, (low, _) in ends.items()},
        "high": {name: high for name, (_, high) in ends.items()},
    }


def hierarchical(given):
    mean, scatter, error = 0.05 + 1e-4 * DRAWS[:, :, 0], 1e-4 + 1e-9 * DRAWS[:, :, 2], DRAWS[:, :, 1]
    names: list[str] = ["mean", "scatter", "load"]
    r_hat, effective = dict.fromkeys(names, 1.001), dict.fromkeys(names, 250.0)
    runs, values = np.zeros((2, 200, 3)), np.full(3, 0.05)
    found = Hierarchical("mu", "", mean, scatter, {"load": error}, runs, values, values / 1e6, r_hat, effective, 0)
    ends = found.intervals()
    return found, {
        "value": [each.mean() for each in (mean, scatter, error)],
        "std": [each.std() for each in (mean, scatter, error)],
        "low": [ends[name][0] for name in names],
        "high": [ends[name][1] for name in names],
        "r_hat": [1.001] * 3,
        "effective": [250.0] * 3,
    }


def profile(given):
    at = np.linspace(0.04, 0.06, 5)
    found = Profile("mu", "", 0.05, 1e-3, at, np.arange(5.0), {"mu": at}, STDS, (0.0481, 0.0523), "bounded")
    reach = 1.959964 * 1e-3
    ends = {"low": [0.0481, 0.05 - reach], "high": [0.0523, 0.05 + reach]}
    return found, {"value": [0.05] * 2, "std": [1e-3] * 2, **ends}


def noise_models(given):
    fit = given.fit
    rows = (NoiseModelRow("white", 12.25, 1, 0.0, 0.0, fit), NoiseModelRow("auto", 0.0, 3, 1.5, 9.5, fit))
    return NoiseModels(rows, "mu"), {
        **{name: [getattr(row, name) for row in rows] for name in ("misfit", "numbers", "aic", "bic")},
        "value": [fit.values["mu"]] * 2,
        "std": [fit.std_errors["mu"]] * 2,
    }


def sandwich(given):
    robust, drawn = ({name: factor * std for name, std in STDS.items()} for factor in (1.25, 1.5))
    found = Sandwich((*FREE,), UNITS, VALUES, STDS, robust, np.eye(3), (0.012,), drawn)
    return found, {"value": VALUES, "std": STDS, "robust_std": robust, "bootstrap_std": drawn, "ratio": found.ratios}


def sobol(given):
    first, total, errors, bounds = np.array([0.2, 0.7]), np.array([0.25, 0.75]), np.array([0.01, 0.02]), np.ones(2)
    ranges = {"mu": (0.03, 0.05), "damping": (0.1, 0.3)}
    found = Sobol((*ranges,), ranges, 1.0, 2.0, first, total, errors, 2 * errors, bounds, bounds, 64)
    columns = {"first": first, "total": total, "first_error": errors, "total_error": 2 * errors, "bound": bounds}
    numbers = {name: dict(zip(ranges, of, strict=True)) for name, of in columns.items()}
    return found, numbers | {"low": {"mu": 0.03, "damping": 0.1}, "high": {"mu": 0.05, "damping": 0.3}}


def optimal_runs(given):
    errors = [{"mu": 2e-7, "damping": 4e-4}, {"mu": 1e-7, "damping": 2e-4}]
    points = (Point(1.25e-3, 9.66, 3, 0.17, errors[0], (0.0, 0.0)), Point(2e-3, 9.66, None, 1.5, errors[1], (0.0, 0.0)))
    found = OptimalRuns({"mu": 1e-7, "damping": 1e-4}, "c", points, False, (1e4, 1e-9))
    return found, {
        **{name: [getattr(point, name) for point in points] for name in ("x0", "normal_force", "duration")},
        "half_cycles": [3, math.nan],
        "mu_relative_std": [2e-7, 1e-7],
        "damping_relative_std": [4e-4, 2e-4],
    }


def design(given):
    order = np.argsort(given.design.runs, kind="stable")
    each = [given.design.informations[i] for i in order]
    return given.design, {
        "x0": given.design.releases[order],
        "runs": given.design.runs[order],
        "half_cycles": [one.motion.half_cycles for one in each],
        "duration": [one.duration for one in each],
        "mu_relative_std": given.design.relative("mu")[order],
    }


def information(given):
    found = given.design.informations[0]
    relative = {name: std / abs(found.values[name]) if found.values[name] else math.inf
                for name, std in found.std_errors.items()}  # fmt: skip
    return found, {"value": found.values, "std": found.std_errors, "relative_std": relative}


def next_release(given):
    outcomes = tuple(Outcome(n, -1e-4 * n, 0.2, 0.05 + n / 1e3, n / 1e4) for n in range(1, 6))
    found = NextRelease(1.5e-3, 0.055, 3e-3, 1e-3, outcomes, np.ones(1), np.ones(1))
    return found, {name: [getattr(each, name) for each in outcomes] for name in Outcome._fields}


def curves(given):
    t, relative = np.array([0.0, 0.02, 0.04]), np.array([[0.0, 1.0], [-3.0, 0.5], [1.0, 0.0]])
    rms = np.sqrt(np.mean(relative**2, axis=0))
    found = Curves(("mu", "x0"), t, relative / 1e3, relative, 1e-3)
    return found, {"largest": [-3.0, 1.0], "t": [0.02, 0.0], "rms": rms}


def agreement(given):
    routes = tuple(Route(f"{i} route", fj.Measured(0.05 + i / 1e6, 2e-6 * i), i) for i in (1, 2, 3))
    found = Agreement(routes, {"4 route": "too short"}, routes[0].mu, 1.0, 2, 1e-4, 1e-3, ())
    means = [route.mu.value for route in routes]
    return found, {
        "mu": [*means, math.nan],
        "mu_std": [2e-6, 4e-6, 6e-6, math.nan],
        "difference": [*(np.array(means) / means[0] - 1), math.nan],
        "runs": [1, 2, 3, math.nan],
    }


def comparison(given):
    rows = tuple(Row(name, name, (), "converged", True, True, 2e3, 5, chi2, aicc, aicc + 20.0, 1.5)
                 for name, chi2, aicc in (("coulomb", 1.0, 2010.0), ("stribeck", 1.25, 2030.0)))  # fmt: skip
    found = Comparison(rows, "bic", ("coulomb", "stribeck"), {"coulomb": given.fit}, 1000, 900.0, 1.0, ())
    names = ("n_parameters", "chi2_reduced", "aicc", "bic", "held_out")
    numbers = {name: [getattr(row, name) for row in rows] for name in names}
    return found, numbers | {"delta_aicc": [0.0, 20.0], "delta_bic": [0.0, 20.0]}


def rig(given):
    numbers = given.rig.numbers()
    return given.rig, table_of(numbers) | {"relative_std": {name: each.relative for name, each in numbers.items()}}


def estimates(given):
    found = Estimates.of({"mu": "", "damping": "N s/m"}, [0.05, 0.2], np.diag([1e-8, 4e-6]), chi2_reduced=4.0)
    return found, {"value": found.values, "std": found.std_errors}


def route_fit(given):
    machine = fj.Rig(mass=0.4, stiffness="2500 +/- 25", damping=0.0, normal_force="10 +/- 0.05")
    found = fj.fit_triangle_map([1.1e-3, 1.5e-3, 2.0e-3], [1e-4, -1e-4, 0.0], machine, half_cycles=[3, 4, 5])
    extras = {name.replace("_", " "): each for name, each in found.extras.items()}
    return found, {
        "value": found.values | {name: each.value for name, each in extras.items()},
        "std": found.std_errors,
        "combined_std": found.combined_std_errors | {name: each.std for name, each in extras.items()},
        "low": {name: low for name, (low, _) in found.intervals.items()},
        "high": {name: high for name, (_, high) in found.intervals.items()},
    }


def interferometer(given):
    found = fj.calibrate_interferometer("632.9908(6) nm", pressure="1013.2(3) hPa")
    return found, table_of(found.inputs) | {"contribution": found.contributions}


def modal(given):
    frequency = np.linspace(10.0, 15.0, 401)
    omega = 2 * np.pi * frequency
    found = fj.calibrate_frf(frequency, 1 / (2574.0 - 0.41 * omega**2 + 0.18j * omega))
    second = table_of(found.peak_picking, "peak_picking", "peak_picking_std")
    return found, table_of(found.numbers(), "least_squares", "least_squares_std") | second


def ringdown(given):
    free = given.rig.oscillator(fj.friction.Coulomb(0.0))
    swing = fj.synthetic_run(free, 2e-3, rate=1e3, duration=2.0, noise=1e-8, seed=1)
    found = fj.calibrate_ringdown(swing, drag=False, friction=False)
    return found, table_of({"natural frequency": found.frequency, "damping ratio": found.damping_ratio})


def force_map(given):
    found = given.force_map
    names = ("velocity", "force", "direction", "branch")
    return found, {name: getattr(found, name) for name in names} | {"force_std": found.std, "samples": found.count}


def force_fit(given):
    found = fj.fit_force_map(given.force_map, fj.friction.Coulomb(0.05), ["mu"])
    return found, {"value": found.values, "std": found.std_errors}


def half_cycles(given):
    found = fj.half_cycle_friction(given.files.run, given.rig)
    return found, {name: getattr(found, name) for name in ("record", "swing", "force")} | {"force_std": found.std}


def motion(given):
    found = fj.simulate(MACHINE, 2e-3, np.linspace(0, 0.6, 12))
    return found, {name: getattr(found, name) for name in ("t", "x", "v", "friction_force", "at_rest")}


def motions(given):
    found = jax.vmap(lambda x0: fj.simulate(MACHINE, x0, np.linspace(0, 0.6, 12)))(np.array([1e-3, 2e-3]))
    t = np.tile(np.linspace(0, 0.6, 12), 2)
    return found, {"motion_0": np.repeat([0, 1], 12), "t": t, "x": found.x.ravel(), "v": found.v.ravel()}


def oscillator(given):
    return MACHINE, {"value": [0.4, 2500.0, 0.2, 10.0, 0.0, 0.05]}


def record(given):
    run = given.runs[0]
    return run, {"t": run.t, "x": run.x, "used": run.mask}


def inspection(given):
    found = fj.data.inspect(given.runs[0])
    names = ("samples", "duration", "rate", "noise", "amplitude", "n_half_cycles", "half_period", "rest_position")
    return found, {name: [getattr(found, name)] for name in names}


def fit(given):
    found = given.fit
    numbers = found.values | {name: each.value for name, each in found.kinematics.items()}
    return found, {"value": numbers, "std": found.std_errors}


def batch(given):
    found = given.batch
    numbers = {name: found.values[name] for name in FREE}
    errors = {f"{name}_combined_std": found.combined_std_errors[name] for name in FREE}
    return found, numbers | errors | {"dead_band": found.kinematics["dead_band"], "chi2_reduced": found.chi2_reduced}


def multistart(given):
    found = fj.multistart(given.runs[0], MACHINE, FREE, starts=2)
    starts = {f"{name}_start": values for name, values in found.starts.items()}
    return found, {**found.ends, **starts, "excess": found.excess, "reached": found.reached}


def archive(given):
    return given.archive, {"mu": given.batch.values["mu"], "mu_std": given.batch.std_errors["mu"]}


CASES = (
    agreement,
    archive,
    batch,
    bootstrap,
    budget,
    comparison,
    curves,
    design,
    estimates,
    fit,
    force_fit,
    force_map,
    half_cycles,
    hierarchical,
    information,
    inspection,
    interferometer,
    modal,
    monte_carlo,
    motion,
    motions,
    multistart,
    next_release,
    noise_models,
    optimal_runs,
    oscillator,
    posterior,
    profile,
    record,
    rig,
    ringdown,
    route_fit,
    sandwich,
    sobol,
)
# Results with fewer numbers per row than four, and their number of numeric columns.
FEW = {"curves": 3, "estimates": 2, "force_fit": 2, "information": 3, "interferometer": 3, "oscillator": 1, "record": 3,
       "rig": 3, "ringdown": 2}  # fmt: skip
# A number as text: "0.21452(31)", "[0.21, 0.23]", "5.0 nm", "< 0.01 %". Names of routes and workers are exempt.
NUMBER = r"[-+]?\d+(\.\d+)?(\([\d.]+\))?(e[-+]\d+)?"
FORMATTED = re.compile(rf"(< )?\[?{NUMBER}((, | to | \+/- ){NUMBER}\]?)?( \D{{1,12}})?")


def numeric(column):
    return column.dtype.kind in "fiub"


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_a_frame_holds_the_numbers_of_the_result_in_si_units(given, case):
    result, expected = case(given)
    frame = result.to_dataframe()
    frame = frame.reset_index() if frame.index.name == "parameter" else frame
    assert all(name.isidentifier() for name in frame)
    for name, numbers in expected.items():
        assert numeric(frame[name]), name
        rows = [numbers.get(key, math.nan) for key in frame.iloc[:, 0]] if isinstance(numbers, dict) else numbers
        np.testing.assert_allclose(np.asarray(frame[name], float), np.asarray(rows), rtol=1e-6, err_msg=name)
    assert sum(numeric(frame[name]) for name in frame) >= FEW.get(case.__name__, 4)
    for name in frame:
        texts = [cell for cell in frame[name] if isinstance(cell, str)]
        assert name in ("route", "worker") or not any(map(FORMATTED.fullmatch, texts)), (name, texts[:3])
    units = frame.attrs.get("units", {})
    assert set(units) <= set(frame) and all(isinstance(unit, str) for unit in units.values())


def test_every_result_is_in_the_table(given):
    package = Path(inspect.getfile(fj)).parent
    for path in package.rglob("*.py"):
        if "Reported" in path.read_text():
            importlib.import_module(".".join(path.relative_to(package.parent).with_suffix("").parts))
    found, classes = [Reported], set()
    while found:
        found += (below := found.pop().__subclasses__())
        classes |= {each for each in below if not inspect.isabstract(each) and each.__module__.startswith("fricjax")}
    assert classes == {type(case(given)[0]) for case in CASES}
