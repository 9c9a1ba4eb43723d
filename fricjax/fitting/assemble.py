"""Assemble the result of a fit from the solved problem."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..estimation.covariance import COVERAGE, Covariance, covariance
from ..estimation.loss import Squares
from ..estimation.space import LINEAR, Parameter
from ..oscillator import Oscillator
from ..oscillator.oscillator import leaves_of
from ..rig import Measured
from ..show import rotary_unit
from .derived import contributions, kinematics
from .diagnostics import flags_of, misfit_of, optimum_found, with_faults
from .names import find_leaf
from .noise import Whiteness, whiteness
from .noise_weighting import NoiseWeighted
from .problem import Problem
from .rest import CONTRADICTED, Bracket, bracket_static, excess_at_reversals, rest_margin
from .result import Fit, named
from .solve import Solution
from .tabulate import untabulated
from .trials.outcome import conclude
from .trials.refits import alternatives
from .warnings import warnings_of_model, warnings_of_run
from .window import NEVER, OF_RESIDUALS


def assemble(weighted: NoiseWeighted, sigma_mode: str, trials: bool = True) -> Fit:
    """Return the result of a fit.

    Args:
        weighted: the solved fit.
        sigma_mode: as for :func:`fricjax.fit`.
        trials: whether other models are tried if the residuals are not white.
    """
    problem, solution, slope = weighted.problem, weighted.solution, weighted.solution.derived.slope
    misfit = with_faults(problem, misfit_of(problem, solution, weighted.noises, sigma_mode != "absolute"))
    matrices = solution.shape, slope, solution.evaluation.normal, weighted.variance
    alternative = alternatives(weighted) if trials else []
    outcome = conclude(weighted, covariance(*matrices, weighted.unsure), misfit, alternative)
    covariances = covariance(*matrices, weighted.unsure + outcome.additional)
    runs = range(len(problem.windows))
    margins = tuple(rest_margin(problem, solution, run) for run in runs)
    excesses = tuple(excess_at_reversals(problem, solution, run) for run in runs)
    residuals, rms = _residuals(problem, solution)
    bracket, name = bracket_static(problem, solution), problem.bracketed or "mu_s"
    machine, static = _machine(problem, solution, bracket)
    shown = solution.derived.values + problem.origins
    values = named(problem.names, shown)
    std_errors = named(problem.names, np.sqrt(np.diag(covariances.statistical)))
    factor = np.sqrt(weighted.scatter) if sigma_mode == "estimate" else 1.0
    parts = contributions(problem.names, solution.derived, covariances)
    warnings = (
        *outcome.warnings,
        *warnings_of_run(problem, values, misfit, weighted.others),
        *warnings_of_model(problem, values, margins, excesses, bracket, solution.numerical_shift),
    )
    return Fit(
        names=problem.names,
        values={**values, **static},
        std_errors=std_errors,
        white_std_errors=named(problem.names, weighted.white * slope),
        combined_std_errors=named(problem.names, np.sqrt(np.diag(covariances.combined))),
        intervals={**_intervals(problem.names, shown, covariances), **({} if bracket is None else {name: bracket[:2]})},
        covariance=covariances.statistical,
        combined_covariance=covariances.combined,
        units={**{p.name: unit_of(p, problem) for p in problem.parameters}, **dict.fromkeys(static, "")},
        flags={**flags_of(problem, covariances, solution), **_static_flags(name, static, bracket)},
        converged=optimum_found(outcome.status),
        status=outcome.status,
        warnings=warnings,
        kinematics=_kinematics(solution, covariances, parts),
        inputs=problem.inputs,
        contributions={name: named(tuple(problem.inputs), each) for name, each in parts.items()},
        chi2=solution.chi2 / factor**2,
        dof=problem.dof,
        residuals=residuals,
        residual_rms=rms,
        **_noise(problem, factor, sigma_mode),
        noise=problem.noise,
        noises=weighted.noises,
        whiteness=_whiteness(problem, solution),
        margins=margins,
        **{name: getattr(solution, name) for name in ("iterations", "stages", "passes", "numerical_shift")},
        engine="exact" if weighted.plain else type(problem.residual.engine).__name__.lower(),
        **_criteria(weighted, sigma_mode),
        oscillator=machine,
        **_of_the_runs(problem),
        engine_used=untabulated(problem.residual).engine,
        problem=problem,
    )


def _kinematics(solution: Solution, covariances: Covariance, parts: Mapping[str, np.ndarray]) -> dict[str, Measured]:
    """Return the kinematics, with uncertainties that include the rig's inputs."""
    estimates = kinematics(solution.derived, covariances)
    return {
        name: dataclasses.replace(each, std=float(np.hypot(each.std, np.linalg.norm(parts[name]))))
        for name, each in estimates.items()
    }


def _noise(problem: Problem, factor: float, sigma_mode: str) -> dict[str, Any]:
    """Return the noise level of a sample, its meaning and its source.

    `factor` scales the stated level.
    """
    stated = np.concatenate([w.sigma[w.used] for w in problem.windows])
    source = OF_RESIDUALS if sigma_mode == "estimate" else problem.windows[0].sigma_source
    return {"sigma": float(np.median(stated) * factor), "sigma_mode": sigma_mode, "sigma_source": source}


def _of_the_runs(problem: Problem) -> dict[str, Any]:
    """Return the fields of the result that `predict` and the plot need."""
    runs, windows = untabulated(problem.residual).runs, problem.windows
    counts, sizes = [int(run.half_cycles) for run in runs], [w.used.size for w in windows]
    return {
        "half_cycles": tuple(None if count >= NEVER else count for count in counts),
        "quantity": windows[0].quantity,
        "sources": tuple(w.name for w in windows),
        "times": tuple(np.asarray(w.trace.t) for w in windows),
        # Drop the samples that pad a run.
        "runs": tuple(
            run._replace(t=run.t[:n], x=run.x[:n], weight=run.weight[:n]) for run, n in zip(runs, sizes, strict=True)
        ),
        "origins": tuple(w.origin for w in windows),
    }


def unit_of(parameter: Parameter, problem: Problem) -> str:
    """Return the unit of a parameter; a rotary rig has rotary units.

    Offset and drift have the unit of the reading.
    """
    observation = problem.windows[0].observation
    if parameter.kind in LINEAR:
        return {"offset": observation.unit, "drift": observation.drift_unit}[parameter.kind]
    return rotary_unit(parameter.unit, observation.motion)


def _whiteness(problem: Problem, solution: Solution) -> Whiteness:
    """Return the whiteness test of the least white run.

    The loss weights the residuals.
    """
    parts = [
        part[w.used] for part, w in zip(problem.by_run(solution.evaluation.residual), problem.windows, strict=True)
    ]
    if not isinstance(problem.loss, Squares):
        parts = [part * np.asarray(problem.loss.parts(jnp.asarray(part))[1]) for part in parts]
    results = [whiteness(part) for part in parts]
    return max(results, key=lambda result: (not result.white, result.correlation_time))


def _residuals(problem: Problem, solution: Solution) -> tuple[Any, float]:
    """Return measured minus model for each run, and the overall RMS."""
    weighted = zip(problem.by_run(solution.evaluation.residual), problem.windows, strict=True)
    parts = [np.where(window.used, -part * window.sigma, np.nan) for part, window in weighted]
    fitted = np.concatenate([part[window.used] for part, window in zip(parts, problem.windows, strict=True)])
    rms = float(np.sqrt(np.mean(fitted**2)))
    return (parts[0] if len(parts) == 1 else tuple(parts)), rms


def _machine(problem: Problem, solution: Solution, bracket: Bracket | None) -> tuple[Oscillator, dict[str, float]]:
    """Return the fitted oscillator, and the bracketed static coefficient by name.

    The coefficient is the middle of its interval. If the stops contradict each other or give no upper limit, it is NaN,
    and the oscillator gets the dynamic coefficient.
    """
    # Numpy values are concrete outside of jit, so a simulation can select the fastest engine.
    machine = solution.derived.machine
    if bracket is None or problem.bracketed is None:
        return machine, {}
    known = bracket.upper < np.inf and not bracket.contradicted
    dynamic = float(machine.friction.dynamic_force(machine.normal_force) / machine.normal_force)
    middle = (bracket.lower + bracket.upper) / 2 if known else np.nan
    index = find_leaf(problem.bracketed, leaves_of(machine)).index
    machine = eqx.tree_at(lambda o: jax.tree.leaves(o)[index], machine, np.asarray(middle if known else dynamic))
    return machine, {problem.bracketed: middle}


def _static_flags(name: str, static: dict[str, float], bracket: Bracket | None) -> dict[str, tuple[str, ...]]:
    flags = ["bracketed, not fitted"] if static else []
    if bracket is not None and bracket.contradicted:
        flags.append(CONTRADICTED)
    return {name: tuple(flags)} if flags else {}


def _intervals(names: Sequence[str], values: np.ndarray, covariances: Covariance) -> dict[str, tuple[float, float]]:
    half = COVERAGE * np.sqrt(np.diag(covariances.statistical))
    return {name: (float(v - h), float(v + h)) for name, v, h in zip(names, values, half, strict=True)}


def _criteria(weighted: NoiseWeighted, sigma_mode: str) -> dict[str, float]:
    """Return the information criteria AICc and BIC.

    AICc is Akaike's criterion for small samples. Both hold up to a constant common to all models of a record. The sum
    of losses takes the part of -2 log(likelihood) of white noise. A noise model adds its change of that value, and its
    number of parameters.
    """
    misfit, n = 2 * float(weighted.solution.evaluation.cost), weighted.problem.n_used
    k = len(weighted.problem.parameters) + weighted.numbers
    criterion, k = (misfit, k) if sigma_mode == "absolute" else (n * np.log(misfit / n), k + 1)
    criterion = criterion + weighted.gain
    aicc = criterion + 2 * k + 2 * k * (k + 1) / max(n - k - 1, 1)
    return {"aicc": float(aicc), "bic": float(criterion + k * np.log(n))}
