"""The main job: from a record to the coefficients of an oscillator with friction."""

from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np

from ..data import Record, Trace
from ..data.errors import UsageError, nearest
from ..oscillator import Oscillator, require_x64
from ..oscillator.engines import AbstractEngine
from .covariance import Covariance, covariance
from .kinematics import kinematics
from .names import find_leaf, leaves_of
from .problem import Problem, Request, pose
from .residual import Run
from .rest import bracket_static, rest_margin, solve_with_rest
from .result import Fit, FitError, named
from .solve import Solved
from .verdict import error_inflation, flags_of, status_of, warnings_of
from .whiteness import Whiteness, whiteness
from .window import NEVER

SIGMA_MODES = ("absolute", "scale", "estimate")
_COVERAGE = 1.959963984540054
# On a rotary rig angles stand for displacements, torques for forces and the moment of inertia for the mass.
_ROTARY = {
    "m": "rad",
    "m/s": "rad/s",
    "kg": "kg m^2",
    "N": "N m",
    "N/m": "N m/rad",
    "N/m^3": "N m/rad^3",
    "N s/m": "N m s/rad",
    "N s^2/m^2": "N m s^2/rad^2",
}


def fit(
    data: Record | Trace | Sequence[Record | Trace],
    oscillator: Oscillator,
    free: Sequence[str],
    *,
    nuisance: Sequence[str] | None = None,
    engine: str | AbstractEngine = "auto",
    start: str | float = "first_reversal",
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, Any] | None = None,
    tie: Mapping[str, Any] | None = None,
    sigma_mode: str = "absolute",
    rig: Any = None,
    throw: bool = True,
) -> Fit:
    """Fit an oscillator with friction to a free decay.

    Start values of mu, damping, drag and stiffness (or mass) come from the decay itself, so those of `oscillator` only
    matter for what is not free and for the extras of the law.

    Args:
        data: a record, a trace, or a list of either for a joint fit of one machine to several runs.
        oscillator: the machine and its friction law.
        free: names of the coefficients to fit: "mu", "damping", "stiffness", "sigma0" ...; where two leaves share a
            name the dotted path, "friction.0.mu". The static coefficient of a Coulomb law is bracketed, not fitted.
        nuisance: names of each run's own parameters (x0, v0, offset, drift, t_release); None for those that belong
            to `start`. An offset or a drift that is not among them is zero, the others keep their start values.
            Offset and drift are those at the first fitted sample; release times are those of the record.
        engine: "auto", "exact", "hybrid", "smooth" or an engine.
        start: "first_reversal" skips the transient of the release and fits time (`t_release`), position (`x0`) and
            offset of the first turning point; for laws with internal states it fits x0, v0 and offset in the middle
            of the stroke before it, where these states are known. "release" fits x0 and offset, at rest at the
            logged release or at the first sample of a bare trace. A number of seconds from the first sample fits x0,
            v0 and offset there.
        bounds: lower and upper bound by name, None for none: {"damping": (0, None)}.
        priors: mean and standard deviation by name, as a pair or a `Measured`.
        tie: leaves that follow a free parameter: {"friction.1.mu": "friction.0.mu"} or {...: (name, factor)}.
        sigma_mode: "absolute" takes the noise of the trace at its word (estimated from the record where it gives none);
            "scale" takes it as relative weights and scales the standard errors by sqrt(chi^2 reduced); "estimate"
            ignores it and takes the noise from the scatter of the residuals.
        rig: a `Rig` whose uncertain inputs enter the combined standard errors to first order.
        throw: raise where the fit is not valid; otherwise its status says so.

    Returns:
        The fit.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: names or settings that do not fit, or parameters that no trace can tell apart.
        DataError: a record that cannot be fitted.
        FitError: a fit that is not valid, unless `throw` is False.
    """
    require_x64()
    if sigma_mode not in SIGMA_MODES:
        raise UsageError(
            f"There is no sigma_mode {sigma_mode!r}.{nearest(sigma_mode, SIGMA_MODES)} Choose {SIGMA_MODES}."
        )
    records = _records(data)
    if not isinstance(oscillator, Oscillator):
        raise UsageError(
            f"fit needs an Oscillator, got {type(oscillator).__name__}. Build one, or take rig.oscillator(friction)."
        )
    request = Request(
        oscillator=oscillator,
        free=(free,) if isinstance(free, str) else tuple(free),
        nuisance=None if nuisance is None else tuple(nuisance),
        engine=engine,
        start=start,
        bounds=bounds or {},
        priors=priors or {},
        tie=tie or {},
        rig=rig,
    )
    problem, solved = solve_with_rest(_posed(records, request, sigma_mode))
    _check_effect(problem, solved)
    result = _report(problem, solved, sigma_mode)
    if throw and not result.converged:
        raise FitError(f"The fit is not valid, {result.status}", result)
    return result


def _records(data: Any) -> tuple[Record | Trace, ...]:
    """The records to fit, also where there is but one."""
    records = tuple(data) if isinstance(data, list | tuple) else (data,)
    if not records:
        raise UsageError("There is no record to fit: the list is empty.")
    for record in records:
        if not isinstance(record, Record | Trace):
            raise UsageError(
                f"fit takes records or traces, got {type(record).__name__}. Read a file with fricjax.read(path), or "
                "wrap arrays as fricjax.Trace(t, x)."
            )
    return records


def _posed(records: Sequence[Record | Trace], request: Request, sigma_mode: str) -> Problem:
    """The problem; with the noise to be estimated, stated noise is left out so that all samples weigh the same."""
    if sigma_mode == "estimate":
        records = [_without_sigma(record) for record in records]
    return pose(records, request)


def _check_effect(problem: Problem, solved: Solved) -> None:
    """Refuse free parameters on which the motion does not depend at all.

    Raises:
        UsageError: names them.
    """
    slopes = np.diag(np.asarray(solved.normal))
    idle = [p.name for p, slope in zip(problem.parameters, slopes, strict=False) if slope == 0]
    if idle:
        raise UsageError(
            f"{' and '.join(idle)} cannot be fitted: the fitted motion does not depend on it. Take it out of free."
        )


def _without_sigma(record: Record | Trace) -> Record | Trace:
    if isinstance(record, Record):
        return Record(_without_sigma(record.trace), record.meta, record.log)  # type: ignore[arg-type]
    return Trace(record.t, record.x, mask=record.mask)


def _report(problem: Problem, solved: Solved, sigma_mode: str) -> Fit:
    dof = max(problem.n_used + problem.n_priors - len(problem.parameters), 1)
    variance = 1.0 if sigma_mode == "absolute" else solved.chi2 / dof
    found = covariance(problem, solved, variance)
    white = _whiteness(problem, solved)
    inflation = error_inflation(white, solved.chi2 / dof, sigma_mode)
    values = problem.residual.values(solved.y)
    margins = tuple(rest_margin(problem.residual, solved.y, run) for run in range(len(problem.windows)))
    residuals, rms = _residuals(problem, solved)
    machine, intervals, static = _machine(problem, solved, found)
    shown = _record_time(problem, np.asarray(values))
    std_errors = named(problem.names, np.sqrt(np.diag(found.statistical)))
    noise = np.concatenate([w.sigma[w.used] for w in problem.windows])
    factor = np.sqrt(variance) if sigma_mode == "estimate" else 1.0
    ok = solved.converged and found.full_rank and bool(np.all(np.isfinite(shown)))
    return Fit(
        names=problem.names,
        values={**named(problem.names, shown), **static},
        std_errors=std_errors,
        combined_std_errors=named(problem.names, np.sqrt(np.diag(found.combined))),
        intervals={**_intervals(problem.names, shown, found), **intervals},
        covariance=found.statistical,
        combined_covariance=found.combined,
        units={**{p.name: _unit(p.unit, problem) for p in problem.parameters}, **dict.fromkeys(static, "")},
        flags={**flags_of(problem, found, solved, inflation), **dict.fromkeys(static, ("bracketed, not fitted",))},
        converged=ok,
        status=status_of(solved, found, problem.names),
        warnings=warnings_of(problem, named(problem.names, shown), std_errors, white, inflation, rms, margins),
        kinematics=kinematics(problem.residual, solved.y, found.statistical),
        chi2=solved.chi2 / factor**2,
        dof=dof,
        residuals=residuals,
        residual_rms=rms,
        sigma=float(np.median(noise) * factor),
        sigma_mode=sigma_mode,
        sigma_source="scatter of the residuals" if sigma_mode == "estimate" else problem.windows[0].sigma_source,
        whiteness=white,
        error_inflation=inflation,
        margins=margins,
        half_cycles=tuple(_count(run) for run in problem.residual.runs),
        iterations=solved.iterations,
        stages=solved.stages,
        passes=solved.passes,
        engine=type(problem.residual.engine).__name__.lower(),
        **_criteria(solved, len(problem.parameters), problem.n_used, sigma_mode),
        oscillator=machine,
        quantity=problem.windows[0].quantity,
        times=tuple(np.asarray(w.trace.t) for w in problem.windows),
        runs=problem.residual.runs,
        origins=tuple(w.origin for w in problem.windows),
        engine_used=problem.residual.engine,
    )


def _count(run: Run) -> int | None:
    return None if int(run.half_cycles) >= NEVER else int(run.half_cycles)


def _unit(unit: str, problem: Problem) -> str:
    return _ROTARY.get(unit, unit) if problem.windows[0].quantity == "rad" else unit


def _record_time(problem: Problem, values: np.ndarray) -> np.ndarray:
    """Values with the release times counted as in the record."""
    shown = values.copy()
    first = len(problem.residual.space.leaves)
    for window, names in zip(problem.windows, problem.residual.space.nuisances, strict=True):
        for i, name in enumerate(names):
            shown[first + i] += window.origin if name == "t_release" else 0.0
        first += len(names)
    return shown


def _whiteness(problem: Problem, solved: Solved) -> Whiteness:
    """The verdict on the run whose residuals are the least white."""
    r, first, verdicts = np.asarray(solved.residual), 0, []
    for window in problem.windows:
        verdicts.append(whiteness(r[first : first + window.used.size][window.used]))
        first += window.used.size
    return max(verdicts, key=lambda verdict: (not verdict.white, verdict.correlation_time))


def _residuals(problem: Problem, solved: Solved) -> tuple[Any, float]:
    """Measured minus model for each run, and the root mean square of all."""
    r, first, parts = np.asarray(solved.residual), 0, []
    for window in problem.windows:
        part = -r[first : first + window.used.size] * window.sigma
        parts.append(np.where(window.used, part, np.nan))
        first += window.used.size
    fitted = np.concatenate([part[window.used] for part, window in zip(parts, problem.windows, strict=True)])
    rms = float(np.sqrt(np.mean(fitted**2)))
    return (parts[0] if len(parts) == 1 else tuple(parts)), rms


def _machine(
    problem: Problem, solved: Solved, found: Covariance
) -> tuple[Oscillator, dict[str, tuple[float, float]], dict[str, float]]:
    """The fitted oscillator, with a bracketed static coefficient at the middle of its interval."""
    # As numpy arrays its values are known outside of jit, so that a simulation may choose the fastest engine.
    machine = jax.tree.map(np.asarray, problem.residual.machine(solved.y))
    bracket = bracket_static(problem, solved.y)
    if bracket is None:
        return machine, {}, {}
    if problem.bracketed is None:
        return machine, {"mu_s": bracket}, {}
    middle = float(np.mean(bracket))
    index = find_leaf(problem.bracketed, leaves_of(machine)).index
    machine = eqx.tree_at(lambda o: jax.tree.leaves(o)[index], machine, np.asarray(middle))
    return machine, {problem.bracketed: bracket}, {problem.bracketed: middle}


def _intervals(names: Sequence[str], values: np.ndarray, found: Covariance) -> dict[str, tuple[float, float]]:
    half = _COVERAGE * np.sqrt(np.diag(found.statistical))
    return {name: (float(v - h), float(v + h)) for name, v, h in zip(names, values, half, strict=True)}


def _criteria(solved: Solved, p: int, n: int, sigma_mode: str) -> dict[str, float]:
    """Akaike's criterion for small samples and the Bayesian one, up to a constant common to all models of a record."""
    misfit, k = (solved.chi2, p) if sigma_mode == "absolute" else (n * np.log(solved.chi2 / n), p + 1)
    aicc = misfit + 2 * k + 2 * k * (k + 1) / max(n - k - 1, 1)
    return {"aicc": float(aicc), "bic": float(misfit + k * np.log(n))}
