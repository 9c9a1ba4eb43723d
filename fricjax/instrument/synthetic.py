"""Synthetic runs: simulated interferometer records of a rig with known coefficients.

First the motion is simulated: the mass is held, released (at once, or gradually by a magnet), and slides to rest on a
floor that may vibrate. Then the reading of the instrument is simulated. Each random effect has a separate random
stream, so switching one effect on does not change the others. The same seed gives the same record to the last bit.
"""

import dataclasses
from typing import Any

import jax
import numpy as np

from ..data.observation import Observation, observed_as
from ..data.record import Record, Step
from ..data.trace import Trace
from ..errors import UsageError, check_type, nearest
from ..friction.base import laws_of
from ..numbers import number
from ..oscillator import RESULTS, ExponentialRelease, Motion, Oscillator, is_successful, observe, simulate
from ..oscillator.oscillator import leaves_of
from ..oscillator.restoring import Pendulum
from ..show.working import working
from .interferometer import Interferometer
from .run import Run, check_seed

# The order determines the random numbers of a seed: add new streams at the end.
_STREAMS = ("floor", "sampling_jitter", "noise")


@working("Computing a synthetic run")
def synthetic_run(
    oscillator: Oscillator,
    x0: float,
    *,
    rate: float,
    duration: float,
    noise: float = 1e-9,
    seed: int = 0,
    v0: float = 0.0,
    hold: float = 0.0,
    release_time_constant: float = 0.0,
    floor_acceleration_psd: float = 0.0,
    **instrument: Any,
) -> Record:
    """Simulate the record of a displacement interferometer, or of another sensor.

    The numbers of the instrument are then in the unit of its reading: noise and offset (bias) of a gyroscope are in
    rad/s, and its drift is in rad/s^2.

    Args:
        oscillator: the machine and its friction law, with the true coefficients.
        x0: displacement at which the mass is held and released [m] ([rad] for a pendulum).
        rate: sampling rate [Hz].
        duration: length of the record including the hold [s]; the record has rate times duration samples and begins at
            0 s.
        noise: standard deviation of the white noise [m].
        seed: seed of all random numbers.
        v0: velocity at release [m/s].
        hold: time at rest at `x0` before the release [s]; the release is at ``t = hold``.
        release_time_constant: decay time of the force of the holding magnet [s]; 0: instantaneous release.
        floor_acceleration_psd: one-sided power spectral density of the white floor acceleration [(m/s^2)^2/Hz].
        **instrument: the other fields of :class:`Interferometer`: `quantisation`, `offset`, `drift`,
            `periodic_nonlinearity`, `wavelength`, `passes`, `sampling_jitter`, `scale_error`. And `observation`, the
            map from the motion to the reading: "displacement", "velocity", "acceleration", or an
            :class:`fricjax.Observation`.

    Returns:
        The record. `trace.sigma` combines noise and rounding (None without both). `meta` contains everything needed to
        reproduce the record, and the true coefficients by name under `"coefficients"`. The log has one step per effect.

    Raises:
        UsageError: a keyword is unknown, or a value is outside its range.
        RuntimeError: JAX computes in single precision.

    Examples:
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> record = fj.synthetic_run(oscillator, 2e-3, rate=1000.0, duration=0.5, offset=1e-6, seed=1)
        >>> record.trace.x.shape, [step.name for step in record.log]
        ((500,), ['motion', 'offset', 'noise'])
    """
    run = Run(x0, v0, rate, duration, hold, release_time_constant, floor_acceleration_psd)
    named = instrument.pop("observation", "displacement")
    interferometer = _interferometer(noise, instrument)
    # By their shortest unambiguous names, as in a fit.
    check_type("oscillator", oscillator, Oscillator, "an Oscillator")
    leaves = zip(leaves_of(oscillator), jax.tree.leaves(oscillator), strict=True)
    coefficients = {leaf.name: number(leaf.name, value) for leaf, value in leaves}
    check_seed(seed)
    # One independent stream per effect: switching one effect on does not change the others.
    children = np.random.SeedSequence(int(seed)).spawn(len(_STREAMS))
    generators = {name: np.random.default_rng(child) for name, child in zip(_STREAMS, children, strict=True)}
    t = np.arange(run.samples) / run.rate
    observed = observed_as(named, "rad" if isinstance(oscillator.restoring, Pendulum) else "m")
    _check_effects(observed, interferometer)
    x, v, moved = _motion(oscillator, run, t, generators["floor"], observed)
    x, effects = interferometer.observe(t, x, v, generators)
    meta = _meta(oscillator, coefficients, run, interferometer, int(seed), observed)
    return Record(Trace(t, x, sigma=interferometer.sigma or None), meta, (*moved, *effects))


def _interferometer(noise: float, instrument: dict[str, Any]) -> Interferometer:
    names = [field.name for field in (*dataclasses.fields(Interferometer), *dataclasses.fields(Run))]
    known = [*names, "observation", "seed"]
    for name in instrument:
        if name not in known:
            raise UsageError(f"synthetic_run has no keyword {name!r}.{nearest(name, known)} It has {', '.join(known)}.")
    return Interferometer(noise=noise, **instrument)


def _check_effects(observation: Observation, interferometer: Interferometer) -> None:
    """Refuse effects that only a displacement has."""
    only = ("periodic_nonlinearity", "sampling_jitter")
    for name in only if observation.kind != "displacement" else ():
        if np.any(getattr(interferometer, name)):
            raise UsageError(f"{name} is an effect of a displacement sensor. Leave it out for a {observation.kind}.")


def _motion(
    oscillator: Oscillator, run: Run, t: np.ndarray, generator: np.random.Generator, observation: Observation
) -> tuple[np.ndarray, np.ndarray, tuple[Step, ...]]:
    """True reading and velocity at the sample times, and log steps."""
    conditions = {"x0": run.x0, "v0": run.v0, "rate": run.rate, "duration": run.duration, "hold": run.hold}
    steps = [Step("motion", conditions, f"{t.size} samples of a release from {run.x0:g} at {run.hold:g} s")]
    floor = release = None
    if run.release_time_constant:
        release = ExponentialRelease(run.release_time_constant)
        text = f"the holding force decays with {run.release_time_constant:g} s"
        steps.append(Step("release", {"release_time_constant": run.release_time_constant}, text))
    if run.floor_acceleration_psd:
        floor = white_acceleration(t.size, run.rate, run.floor_acceleration_psd, generator)
        text = f"white floor acceleration of {floor.std():.3g} m/s^2 rms up to {run.rate / 2:g} Hz drives the mass"
        steps.append(Step("floor_motion", {"floor_acceleration_psd": run.floor_acceleration_psd}, text))
    motion = _integrate(oscillator, run, t - run.hold, floor, release)
    reading = np.asarray(observe(oscillator, motion, observation, base_acceleration=floor))
    if observation.kind != "displacement":
        conditions = {name: value for name, value in dataclasses.asdict(observation).items() if name != "motion"}
        steps.append(Step("observation", conditions, f"{observation.name.lower()} in {observation.unit}"))
    before_release = t < run.hold
    still = observation.read(np.float64(0.0 if observation.order else run.x0))
    return np.where(before_release, still, reading), np.where(before_release, 0.0, motion.v), tuple(steps)


def _integrate(
    oscillator: Oscillator, run: Run, ts: np.ndarray, floor: np.ndarray | None, release: ExponentialRelease | None
) -> Motion:
    """Integrate the motion with an engine that can follow it.

    The result before the release has no meaning.
    """
    drive: dict[str, Any] = {"v0": run.v0, "base_acceleration": floor, "release": release}
    motion = simulate(oscillator, run.x0, ts, **drive)
    if not is_successful(motion.result) and oscillator.friction.set_valued:
        # A motion without half-cycles, such as that of an overdamped mass, needs integration in time.
        motion = simulate(oscillator, run.x0, ts, engine="diffrax", **drive)
    if not is_successful(motion.result):
        raise UsageError(f"The motion could not be computed: {RESULTS[motion.result]}")
    return motion


def _meta(
    oscillator: Oscillator,
    coefficients: dict[str, float],
    run: Run,
    interferometer: Interferometer,
    seed: int,
    observation: Observation,
) -> dict[str, Any]:
    laws = laws_of(oscillator.friction)
    parameters = {**dataclasses.asdict(run), **dataclasses.asdict(interferometer), "seed": seed}
    parameters["periodic_nonlinearity"] = list(parameters["periodic_nonlinearity"])
    return {
        "source": "synthetic run",
        "format": "synthetic",
        "columns": {"t": "t", "x": "x"},
        "units": {"t": "s", "x": observation.unit},
        **observation.meta,
        "release_time": run.hold,
        "friction": " + ".join(type(law).__name__ for law in laws),
        "restoring": type(oscillator.restoring).__name__,
        "coefficients": coefficients,
        "parameters": parameters,
    }


def white_acceleration(samples: int, rate: float, density: float, generator: np.random.Generator) -> np.ndarray:
    """Draw white floor acceleration at the sample times [m/s^2], shape (samples,).

    The acceleration is white up to half the sampling rate and drives the mass with the force ``-m a_floor``. It is
    process noise: unlike the noise of the interferometer, its effect at one instant persists in all later samples. With
    the one-sided density ``S``, the amplitude changes at random by ``sqrt(S H)/(2 omega)`` in half a period ``H``, and
    the variance of a mass without contact is ``S/(8 zeta omega^3)`` (Miles, 1954).

    Between samples the simulation interpolates it linearly, which multiplies its density at the frequency ``f`` by
    ``sinc^4(f/rate)``: 1 - 4e-5 at 13 Hz and 5 kHz.

    Args:
        samples: number of samples.
        rate: sampling rate [Hz].
        density: one-sided power spectral density [(m/s^2)^2/Hz].
        generator: random number generator.

    Examples:
        >>> floor = white_acceleration(10000, rate=1000.0, density=2e-6, generator=np.random.default_rng(1))
        >>> print(f"{floor.std():.3f} m/s^2")
        0.032 m/s^2
    """
    return np.sqrt(density * rate / 2) * generator.standard_normal(samples)
