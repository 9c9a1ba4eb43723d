"""Fits of records that are proven plain.

They need no segmentation, stages or noise models; other records do.
"""

import functools
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from .. import thresholds
from ..data import Record, Segmentation
from ..data.inspect import implausible_scale
from ..estimation.covariance import quadratic
from ..estimation.loss import Squares
from ..estimation.status import CONVERGED
from ..friction import Coulomb
from ..oscillator.oscillator import leaves_of
from ..oscillator.restoring import Linear
from ..plain import COEFFICIENTS, ITERATIONS, RUN_COEFFICIENTS, PlainFits, decay_slopes, fit_plain
from ..rig.rig import READING
from ..show import rotary_unit
from .derived import UNITS, derive_on_host
from .diagnostics import DESCRIBED
from .evaluation import Evaluation
from .names import NUISANCES
from .noise import Noise
from .noise_weighting import NoiseWeighted
from .parameters import Request
from .problem import Problem, problem_on
from .rig_inputs import contradiction
from .run_fit import RunFit
from .sketch import Sketch, few
from .solve import Solution, with_inputs
from .window import NEVER, OF_RESIDUALS, Window

# Powers of the coefficients in each of the kinematic quantities, and its factor.
_KINEMATICS = {
    "natural_frequency": (1 / (2 * np.pi), {"stiffness": 0.5, "mass": -0.5}),
    "damping_ratio": (0.5, {"damping": 1, "stiffness": -0.5, "mass": -0.5}),
    "dead_band": (1, {"mu": 1, "normal_force": 1, "stiffness": -1}),
    "friction_deceleration": (1, {"mu": 1, "normal_force": 1, "mass": -1}),
    "drag_rate": (0, {}),
}


_AT_REST = {"t_release": 0.0, "v0": 0.0, "drift": 0.0, "z0": 1.0}


class _Even(NamedTuple):
    """Samples at equal intervals.

    Attributes:
        x: readings [m], shape (n,).
        interval: the interval [s].
        lateness: largest deviation of a time from the equal intervals [s].
        sigma: stated noise level [m], or None.
        release: time from the first sample to the release [s], or None if it is fitted.
    """

    x: np.ndarray
    interval: float
    lateness: float
    sigma: float | None
    release: float | None


class _Block(NamedTuple):
    """Plain fits of runs with equal intervals.

    Attributes:
        numbers: numbers of the runs.
        fits: their fits.
        free: names of the fitted coefficients of the machine; `of_run`: those of the run.
        interval: interval of the samples [s].
        sigma: noise level of each run [m]; `source`: where it comes from.
        machine: coefficients of the machine of each run, with the fitted ones.
    """

    numbers: list[int]
    fits: PlainFits
    free: tuple[str, ...]
    of_run: tuple[str, ...]
    interval: float
    sigma: np.ndarray
    source: str
    machine: dict[str, np.ndarray]


def solve_plain(record: Record, request: Request) -> NoiseWeighted | None:
    """Return the fit of a record that is plain, else None."""
    return next((_solved(record, request, block, 0) for block in _blocks([record], [request])), None)


def plain_runs(records: Sequence[Any], requests: Sequence[Request]) -> dict[int, RunFit | NoiseWeighted]:
    """Fit the runs that are plain; return their numbers.

    With uncertain inputs of a rig, the result is the solved problem.

    Args:
        records: a record for each run, or the error of reading it.
        requests: one for each run.
    """
    rows = dict[int, RunFit | NoiseWeighted]()
    for block in _blocks(records, requests):
        columns = _columns(block, [records[i] for i in block.numbers])
        leaves = {leaf.name: leaf.coefficient.unit for leaf in leaves_of(requests[block.numbers[0]].oscillator)}
        si = {name: leaves.get(name, NUISANCES.get(name, "")) for name in (*block.free, *block.of_run)}
        units = {
            quantity: {name: rotary_unit(unit, quantity) for name, unit in si.items()} for quantity in ("m", "rad")
        }
        for place, i in enumerate(block.numbers):
            record, request = records[i], requests[i]
            if request.rig is not None:
                rows[i] = _solved(record, request, block, place)
                continue
            doubts = _doubts(record, request, block, place)
            segmentation = _segmentation(record, block, place)
            scale = implausible_scale(segmentation, block.interval, angular=record.quantity == "rad")
            rows[i] = RunFit(
                status=DESCRIBED,
                units=units[record.quantity],
                flags=dict.fromkeys((*block.free, *block.of_run), ()),
                warnings=(*doubts, *scale),
                noise=Noise(),
                iterations=ITERATIONS,
                passes=ITERATIONS + 1,
                engine="exact",
                segmentation=segmentation,
                load=float(block.machine["normal_force"][place]),
                sketch=functools.partial(_sketch, record, block, place),
                **{name: values[place] for name, values in columns.items()},
            )
    return rows


def _blocks(records: Sequence[Any], requests: Sequence[Request]) -> Iterator[_Block]:
    """Yield the plain fits of runs of equal shape."""
    groups: dict[Any, dict[int, _Even]] = {}
    for i, (record, request) in enumerate(zip(records, requests, strict=True)):
        even = _even_samples(record, request.start) if isinstance(record, Record) and _suits(request) else None
        if even is not None:
            none = even.sigma is None, _static_of(request) is None, even.release is None
            groups.setdefault((even.x.size, even.interval, none, request.free), {})[i] = even
    for (_, interval, (unknown, tied, timed), free), group in groups.items():
        numbers, samples = list(group), list(group.values())
        machines = [_coefficients_of(requests[i]) for i in numbers]
        machine = {name: np.array([each[name] for each in machines]) for name in COEFFICIENTS}
        sigma = None if unknown else np.array([each.sigma for each in samples], dtype=float)
        fits = fit_plain(
            np.stack([each.x for each in samples]),
            interval,
            machine,
            free,
            sigma,
            np.array([each.lateness for each in samples]),
            None if tied else np.array([_static_of(requests[i]) for i in numbers], dtype=float),
            None if timed else np.array([each.release for each in samples]),
        )
        fitted = {name: values[fits.runs] for name, values in machine.items()}
        fitted |= dict(zip(free, fits.values.T, strict=False))
        # A friction coefficient of any size is plausible if the load is unknown.
        plausible = (fitted["mu"] <= thresholds.LARGEST_MU) | (fitted["normal_force"] == 1)
        fits, fitted = fits.only(plausible), {name: values[plausible] for name, values in fitted.items()}
        if not fits.runs.size:
            continue
        level, source = (fits.noise, OF_RESIDUALS) if sigma is None else (sigma[fits.runs], "given")
        of_run = RUN_COEFFICIENTS if timed else RUN_COEFFICIENTS[1:]
        yield _Block([numbers[run] for run in fits.runs], fits, free, of_run, interval, level, source, fitted)


def _even_samples(record: Record, start: str | float) -> _Even | None:
    """Return the samples of a record.

    None if it is not a displacement, samples are missing, their noise varies, or the release lies outside.
    """
    trace = record.trace
    t, x, mask = (np.asarray(each) for each in (trace.t, trace.x, trace.mask))
    if record.observation.kind != "displacement" or not mask.all():
        return None
    if trace.sigma is not None and np.ndim(trace.sigma):
        return None
    interval = float(t[-1] - t[0]) / (t.size - 1)
    lateness = float(np.max(np.abs(t - t[0] - interval * np.arange(t.size))))
    logged = 0.0 if record.release is None else float(record.release - t[0])
    if start == "release" and not 0 <= logged < t[-1] - t[0]:
        return None
    sigma = None if trace.sigma is None else float(np.asarray(trace.sigma))
    return _Even(x, interval, lateness, sigma, logged if start == "release" else None)


def _suits(request: Request) -> bool:
    """Return True if a plain fit can answer a request."""
    machine, law, names = request.oscillator, request.oscillator.friction, set(request.free)
    # A law of a user may derive from Coulomb's.
    fits = type(law) is Coulomb and type(machine.restoring) is Linear and float(machine.drag) == 0
    positive = all(np.isfinite(value) and (value > 0 or name not in names) for name, value in request.guess.items())
    determined = not ({"mass", "stiffness"} <= names or {"mu", "normal_force"} <= names)
    special = (request.bounds, request.priors, request.tie)
    uncertain = set() if request.rig is None else set(request.rig.inputs())
    usual = {"first_reversal": RUN_COEFFICIENTS, "release": RUN_COEFFICIENTS[1:]}.get(str(request.start))
    return (
        fits
        and bool(names)
        and names <= set(COEFFICIENTS)
        and determined
        and len(names) == len(request.free)
        and positive
        and request.guess.keys() <= {*names, *RUN_COEFFICIENTS}
        and not any(special)
        and uncertain.isdisjoint({*READING, "drag"})
        and usual is not None
        and request.nuisance in (None, usual)
        and request.engine == "auto"
        and isinstance(request.loss, Squares)
        and request.noise in ("auto", "white")
    )


def _coefficients_of(request: Request) -> dict[str, float]:
    """Return the coefficients of the machine by name."""
    machine: Any = request.oscillator
    named = {name: float(getattr(machine, name)) for name in COEFFICIENTS if name != "mu"}
    return {**named, "mu": float(machine.friction.mu)}


def _static_of(request: Request) -> Any:
    """Return the fixed static coefficient, or None if it equals mu."""
    law: Any = request.oscillator.friction
    return law.mu_s


def _columns(block: _Block, records: Sequence[Record]) -> dict[str, np.ndarray]:
    """Return numbers of all runs of a block."""
    fits, p = block.fits, len(block.free)
    squares, used = np.sum(fits.residuals**2, axis=1), fits.residuals.shape[1] - fits.at.begins[:, 0]
    covariance = block.sigma[:, None, None] ** 2 * fits.inverse
    values = fits.values.copy()
    if "t_release" in block.of_run:
        values[:, p] += [float(record.t[0]) for record in records]
    quantities = [_kinematic(block, covariance, *_KINEMATICS[name]) for name in UNITS]
    return {
        "values": values,
        "covariance": covariance,
        "white": np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)),
        "kinematics": np.stack(quantities, axis=1),
        "contributions": np.zeros((len(values), p + len(block.of_run) + len(UNITS), 0)),
        "chi2": squares / block.sigma**2,
        "dof": used - values.shape[1],
        "residual_rms": np.sqrt(squares / used),
        "sigma": block.sigma,
        "numerical_shift": fits.remaining,
        "half_cycles": np.where(fits.at.decay.stop < NEVER, fits.at.half_cycles, -1),
    }


def _kinematic(block: _Block, covariance: np.ndarray, factor: float, powers: dict[str, float]) -> np.ndarray:
    """Return a product of powers of the coefficients, and its standard error.

    The shape is (runs, 2).
    """
    value = factor * np.prod([block.machine[name] ** power for name, power in powers.items()], axis=0)
    value = np.broadcast_to(value, block.sigma.shape)
    slope = np.zeros((value.size, covariance.shape[1]))
    for place, name in enumerate(block.free):
        slope[:, place] = powers.get(name, 0) * value / block.machine[name]
    return np.stack([value, np.sqrt(np.einsum("ri,rij,rj->r", slope, covariance, slope))], axis=1)


def _doubts(record: Record, request: Request, block: _Block, place: int) -> tuple[str, ...]:
    """Return the assumptions that were made about record and machine."""
    period = np.pi / float(block.fits.at.decay.omega[place])
    return (*record.doubts, *contradiction(request.oscillator, period))


def _segmentation(record: Record, block: _Block, place: int) -> Segmentation:
    """Return reversals, rest and noise of a record, from its fit."""
    at, noise, t0 = block.fits.at, float(block.fits.noise[place]), float(record.t[0])
    decay, count = at.decay.of(place), int(at.half_cycles[place])
    period = np.pi / float(decay.omega)
    stops = decay.stop < NEVER
    times = t0 + float(decay.t0) + period * np.arange(count + 1)
    points = (at.sides[place] * at.amplitudes.value[place])[: count + 1] + float(decay.offset)
    released = "t_release" not in block.of_run
    # The last one is the stop, or lies behind the record.
    reversals = slice(int(released), count if stops or times[-1] > record.t[-1] else None)
    return Segmentation(
        noise=noise,
        resolution=0.0,
        release=float(times[0]) if released else max(float(times[0]) - period, t0),
        release_position=float(points[0]) if released else None,
        turning_times=times[reversals],
        turning_points=points[reversals],
        rest=float(times[-1]) if stops else None,
        rest_position=float(points[-1]) if stops else None,
        n_half_cycles=count + (not released),
        amplitude=abs(float(decay.x0)),
        half_period=period,
        white_noise=noise,
    )


def _sketch(record: Record, block: _Block, place: int, most: int | None) -> Sketch:
    """Return some samples of record and residual."""
    samples, at = few(record.t.size, most), block.fits.at
    residual = np.where(samples >= at.begins[place, 0], block.fits.residuals[place][samples], np.nan)
    return Sketch((record.t - record.t[0])[samples], record.x[samples] - float(at.decay.offset[place]), residual)


def _solved(record: Record, request: Request, block: _Block, place: int) -> NoiseWeighted:
    """Return the solved problem of one plain fit."""
    fits, at, p = block.fits, block.fits.at, len(block.free)
    segmentation = _segmentation(record, block, place)
    begin, sigma, n = int(at.begins[place, 0]), float(block.sigma[place]), record.t.size
    first = float(record.t[0]) + float(at.decay.t0[place])
    used, stopped = np.arange(n) >= begin, np.inf if segmentation.rest is None else segmentation.rest
    values, start = fits.values[place].copy(), fits.start[place].copy()
    if "t_release" in block.of_run:
        values[p] += float(record.t[0]) - first
        start[p] += float(record.t[0]) - first
    window = Window(
        trace=record.trace,
        observation=record.observation,
        segmentation=segmentation,
        origin=first,
        t_start=first,
        used=used,
        moving=used & (record.t <= stopped),
        repeated=np.zeros(n, bool),
        sigma=np.full(n, sigma),
        sigma_source=block.source,
        half_cycles=int(at.half_cycles[place]) if segmentation.rest is not None else NEVER,
        nuisances=block.of_run,
        guesses={**_AT_REST, **dict(zip(block.of_run, map(float, start[p:]), strict=True))},
        doubts=_doubts(record, request, block, place),
        name=record.name,
    )
    # Start values from the record are not needed.
    problem = problem_on((window,), request.with_guess(dict(zip(block.free, map(float, start), strict=False))))
    space = problem.residual.space
    y = space.coordinates(values)
    slope = np.asarray(space.slope(y))
    jacobian = np.concatenate([_by_name(block, place, problem.names) * slope, _by_input(block, place, problem)], axis=1)
    normal = jacobian.T @ at.normal[place] @ jacobian / sigma**2
    gradient = -jacobian.T @ at.gradient[place] / sigma**2
    y_full = with_inputs(problem.residual, y)
    residual = np.zeros(problem.residual.runs[0].t.size)
    residual[:n] = -fits.residuals[place] / sigma
    chi2 = float(residual @ residual)
    points = (at.sides[place] * at.amplitudes.value[place])[: int(at.half_cycles[place]) + 1]
    p = y.size
    shape = quadratic(gradient[:p], normal[:p, :p], np.zeros(p, bool))
    joined = np.concatenate([residual, np.zeros(y.size)])
    evaluation = Evaluation(joined, chi2, chi2 / 2, gradient, normal, None, [points], [])
    solution = Solution(
        y_full, evaluation, derive_on_host(problem.residual, y_full), shape, float(fits.remaining[place]), CONVERGED,
        ITERATIONS, ITERATIONS + 1, 1,
    )  # fmt: skip
    white = np.sqrt(np.diag(shape.inverse))
    return NoiseWeighted(problem, solution, 1.0, 1.0, white, (Noise(),), np.zeros((p, p)), plain=True)


def _by_name(block: _Block, place: int, names: Sequence[str]) -> np.ndarray:
    """Return the derivatives of the decay by coefficients, shape (6, names)."""
    slopes = decay_slopes({name: values[place : place + 1] for name, values in block.machine.items()})
    return np.stack([slopes[name][0] for name in names], axis=1)


def _by_input(block: _Block, place: int, problem: Problem) -> np.ndarray:
    """Return the derivatives of the decay by the rig, shape (6, inputs)."""
    names = [leaf.kind for leaf in leaves_of(problem.residual.oscillator)]
    # A fitted coefficient does not follow its input.
    moves = [name in COEFFICIENTS and name not in block.free for name in names]
    known = [name for name, moved in zip(names, moves, strict=True) if moved]
    return (
        _by_name(block, place, known) @ problem.residual.inputs[:, : len(names)][:, moves].T
        if known
        else np.zeros((6, 0))
    )
