"""Fit an oscillator with friction to a record."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..data import Record, Trace
from ..data.gather import gather
from ..errors import UsageError, check_choice
from ..estimation.loss import AbstractLoss
from ..oscillator import Oscillator, one_blas_thread, ready
from ..oscillator.engines import AbstractEngine
from ..rig import Rig
from ..show.working import working
from .assemble import assemble
from .noise_weighting import weigh_by_noise
from .parameters import Free, Prior, Request, Settings, Tied
from .plain import solve_plain
from .problem import Problem, build_problem
from .rest import solve_with_rest
from .result import Fit, FitError
from .settings import SIGMA_MODES
from .solve import Solution


@working("Fitting")
@one_blas_thread()
def fit(
    data: object,
    oscillator: Oscillator,
    free: Free,
    *,
    t: ArrayLike | None = None,
    rate: float | None = None,
    nuisance: Sequence[str] | None = None,
    engine: str | AbstractEngine = "auto",
    start: str | float = "first_reversal",
    bounds: Mapping[str, tuple[float | None, float | None]] | None = None,
    priors: Mapping[str, Prior] | None = None,
    tie: Mapping[str, Tied] | None = None,
    sigma_mode: str = "absolute",
    rig: Rig | None = None,
    guess: Mapping[str, float] | None = None,
    loss: str | AbstractLoss = "squares",
    noise: str = "auto",
    throw: bool = True,
) -> Fit:
    """Fit an oscillator with friction to a free decay.

    Start values of mu, damping, drag and stiffness (or mass) follow from the decay. The values in `oscillator` only
    matter for fixed coefficients and for the extra coefficients of the law.

    Args:
        data: a run, or a list of runs for a joint fit of one machine. A run is a record, a path, a table, or times and
            displacements as a tuple ``(t, x)``: any input that `fricjax.read` takes without options. With `t` or `rate`
            the rows of an array of shape (runs, samples) are runs.
        oscillator: the machine and its friction law.
        free: names of the coefficients to fit: "mu", "damping", "stiffness", "sigma0" ...; if two leaves share a name,
            the dotted path, "friction.0.mu". The static coefficient of a Coulomb law is bracketed, not fitted. Or lmfit
            Parameters: those that vary are free, with their values as start values and their bounds; the others are set
            in the machine.
        t: times of runs that are given as displacements only, shape (samples,) [s], for all runs or one for each.
        rate: samples per second of such runs, instead of times: ``fit(x, ..., rate=5000.0)``.
        nuisance: names of the parameters of each run (x0, v0, offset, drift, t_release, z0); None for the default of
            `start`. z0 is the internal state of a bristle law at a start from rest, relative to that after a slow pull:
            1 for a pull, 0 for a relaxed contact. An offset or drift that is not in the list is zero; other parameters
            keep their start values. Offset and drift are those at the first fitted sample; release times are those of
            the record.
        engine: "auto", "exact", "hybrid", "smooth" or an engine. For a law without internal states and a start from
            rest, "auto" takes tables of the forces, which compile nothing.
        start: "first_reversal" skips the transient of the release. It fits time (`t_release`), position (`x0`) and
            offset of the first turning point; for laws with internal states it fits x0, v0 and offset in the middle of
            the half-cycle before it, where these states are known. "release" fits x0 and offset, at rest at the logged
            release or at the first sample of a bare trace. A number of seconds from the first sample fits x0, v0 and
            offset there.
        bounds: lower and upper bound by name, None for none: {"damping": (0, None)}. Without an upper bound a contact
            stiffness is limited to the largest value that all samples together can resolve; a fit that ends there means
            a rigid contact.
        priors: mean and standard deviation by name, as a pair or a `Measured`. A prior weighs like one sample, so with
            a `sigma_mode` other than "absolute" its standard deviation is scaled like white noise.
        tie: leaves that follow a free parameter: {"friction.1.mu": "friction.0.mu"} or {...: (name, factor)}.
        sigma_mode: "absolute" uses the noise level of the trace (estimated from the record if the trace has none),
            unless the residuals are clearly larger. "scale" uses it as relative weights, and scales the standard errors
            by sqrt(chi^2 reduced). "estimate" ignores it, and estimates the noise level from the residuals. Noise that
            is not white is modelled from the residuals in each mode.
        rig: a `Rig` with uncertain inputs of the machine and of its instrument. They enter the combined standard errors
            to first order. Release times remain those of the record, whatever its clock.
        guess: start values by name, instead of those from the record. A plain record needs none.
        loss: "squares", or "huber", "soft_l1" or "cauchy", which reduce the weight of outliers, or a loss of
            :mod:`fricjax.estimation.loss`; in units of the noise. The covariance is then that of the weighted samples.
        noise: noise model for weights and standard errors: "auto" selects it from the record; "white", "jitter",
            "autoregressive", "coloured" or "floor" sets it, with parameters estimated from the residuals.
            :func:`fricjax.uncertainty.noise_models` compares them.
        throw: raise an error if no optimum was found or parameters are undetermined; otherwise the status reports it.

    Returns:
        The fit. `converged` states that an optimum was found, `described` that its model describes the record. If the
        residuals are not white noise, other models are tried, and the status names the one that describes the record.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: invalid names or settings, or parameters that no trace can separate.
        DataError: a record that cannot be fitted.
        FitError: a fit without an optimum or with undetermined parameters, unless `throw` is False.

    ```python
    fricjax.fit("run.csv", oscillator, ["mu", "damping", "stiffness"])
    fricjax.fit((t, x), oscillator, ["mu", "damping", "stiffness"])
    fricjax.fit(x, oscillator, ["mu", "damping", "stiffness"], rate=5000.0)
    ```

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
        >>> run = fj.synthetic_run(machine, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
        >>> fit = fj.fit(run, machine, ["mu", "damping", "stiffness"])
        >>> fit.converged, round(fit.values["mu"], 6), fit.std_errors["mu"] < 1e-6
        (True, 0.05, True)
    """
    ready()
    records = records_of(data, t, rate, sigma_mode)
    where: Settings = {"nuisance": nuisance, "engine": engine, "start": start, "loss": loss, "noise": noise}
    settings: Settings = {**where, "bounds": bounds, "priors": priors, "tie": tie, "rig": rig, "guess": guess}
    request = Request.of(oscillator, free, **settings)
    if len(records) == 1 and sigma_mode == "absolute" and (plain := solve_plain(records[0], request)):
        return assemble(plain, sigma_mode)
    return concluded(*solve_with_rest(build_problem(records, request)), sigma_mode, throw)


def concluded(problem: Problem, solution: Solution, sigma_mode: str, throw: bool, trials: bool = True) -> Fit:
    """Return the fit of a solved problem, after trials of other models.

    Without `trials` no other model is tried.

    Raises:
        UsageError: free parameters on which the motion does not depend.
        FitError: no optimum was found, and `throw` is set.
    """
    if solution.converged:
        check_effect(problem, solution)
    result = assemble(weigh_by_noise(problem, solution, sigma_mode == "absolute"), sigma_mode, trials)
    if throw and not result.optimum_found:
        raise FitError(f"The fit is not valid, {result.status}", result)
    return result


def records_of(data: object, t: ArrayLike | None, rate: float | None, sigma_mode: str) -> tuple[Record, ...]:
    """Return the records to fit, as a tuple.

    If the noise level is to be estimated, stated noise is dropped, so all samples have equal weights.

    Raises:
        UsageError: no run, an invalid input, or an unknown `sigma_mode`.
        DataError: a run that cannot be read.
    """
    check_choice("sigma_mode", sigma_mode, SIGMA_MODES)
    records = gather(data, t, rate)
    if sigma_mode != "estimate":
        return records
    return tuple(Record(Trace(each.t, each.x, mask=each.mask), each.meta, each.log) for each in records)


def check_effect(problem: Problem, solution: Solution) -> None:
    """Refuse free parameters that have no effect on the motion.

    Raises:
        UsageError: the message names them.
    """
    slopes = np.diag(np.asarray(solution.evaluation.normal))
    without_effect = [p.name for p, slope in zip(problem.parameters, slopes, strict=False) if slope == 0]
    if without_effect:
        unloaded = float(problem.residual.oscillator.normal_force) == 0
        raise UsageError(
            f"{' and '.join(without_effect)} cannot be fitted: the fitted motion does not depend on it"
            f"{' under a normal force of zero' if unloaded else ''}. Take it out of free="
            f"{', or give the normal force' if unloaded else ''}."
        )
