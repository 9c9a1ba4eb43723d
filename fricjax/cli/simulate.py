"""``fricjax simulate``: the motion of a known machine, with the instrument."""

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from typer import Option

from ..errors import UsageError
from .options import Machine, Plot, Writing
from .output import deliver, prepare, working
from .targets import PICTURES, RECORDS, check_targets, write_picture

if TYPE_CHECKING:
    from ..data import Record
    from ..machine.choose import Choice
    from ..oscillator import Motion, Oscillator

# Default time at rest at the end of a record [s], as stated in the help page.
_TAIL = 0.05
# Longest run [s]. It replaces a duration that is unknown before the motion is computed.
_FOREVER = 1e9


@dataclasses.dataclass(frozen=True)
class Run:
    """Options for the release and the record."""

    PANEL: ClassVar = "Run"

    x0: Annotated[str, Option("--x0", help='Displacement at release, such as 2e-3 or "2 mm".', show_default=False)]
    rate: Annotated[float, Option(help="Samples per second.")] = 5000.0
    duration: Annotated[
        float | None, Option(help="Length of the record in s. Default: until 50 ms after the stop.")
    ] = None
    v0: Annotated[float, Option("--v0", help="Velocity at release in m/s.")] = 0.0
    hold: Annotated[float, Option(help="Time at rest before the release in s.")] = 0.0
    release_time_constant: Annotated[float, Option(help="Decay time of the holding magnet in s.")] = 0.0
    floor_acceleration_psd: Annotated[
        float, Option(help="One-sided spectral density of a white floor acceleration in (m/s^2)^2/Hz.")
    ] = 0.0
    accuracy: Annotated[float, Option(help="Largest numerical error in m.")] = 1e-10


@dataclasses.dataclass(frozen=True)
class Instrument:
    """Options for the instrument and its errors."""

    PANEL: ClassVar = "Instrument"

    observation: Annotated[
        str, Option(help="Reading: displacement, velocity or acceleration. Its errors are in its own unit.")
    ] = "displacement"
    noise: Annotated[float, Option(help="Standard deviation of white noise in m.")] = 0.0
    quantisation: Annotated[float, Option(help="Smallest count in m.")] = 0.0
    offset: Annotated[float, Option(help="Reading at equilibrium in m.")] = 0.0
    drift: Annotated[float, Option(help="Drift of the reading in m/s.")] = 0.0
    periodic_nonlinearity: Annotated[float, Option(help="Periodic error of first order in m.")] = 0.0
    sampling_jitter: Annotated[float, Option(help="Standard deviation of the sampling instants in s.")] = 0.0
    seed: Annotated[int, Option(help="Seed of the random numbers.")] = 0


def simulate(
    run: Run,
    machine: Machine,
    instrument: Instrument,
    output: Writing,
    out: Annotated[
        # In other commands --out writes a result and --save a record. Here the record is the result.
        Path | None, Option("--out", "--save", help="Write the record (.csv, .npz, .h5).", rich_help_panel="Output")
    ] = None,
    plot: Plot = None,
) -> None:
    """Compute the motion of a known machine as a record."""
    check_targets(output, ("--out", out, RECORDS), ("--plot", plot, PICTURES))
    choice, x0 = _known(run, machine, instrument)
    with working(output, "Simulating"):
        prepare(output)
        motion, record, facts = simulated(run, choice, x0, instrument)
    text = _text(facts, record.observation.motion)

    def write() -> dict[str, str]:
        from ..data import write as write_record

        written = {} if out is None else {"record": str(write_record(record, out, overwrite=output.force))}
        return written | write_picture(output, plot, lambda: _picture(motion, record))

    deliver(output, facts, text, write)


def _known(run: Run, machine: Machine, instrument: Instrument) -> "tuple[Choice, float]":
    """Check all numbers; return the machine and the release [m or rad]."""
    from ..data.observation import observed_as
    from ..instrument.interferometer import Interferometer
    from ..instrument.run import Run as Numbers
    from ..instrument.run import check_seed
    from ..machine import parsing
    from ..machine.choose import known

    choice, x0 = known(machine), parsing.displacement("--x0", run.x0)
    numbers = dataclasses.asdict(run) | {"x0": x0, "duration": _FOREVER if run.duration is None else run.duration}
    del numbers["accuracy"]
    # These constructors check the values. Their results are not used.
    Numbers(**numbers)
    interferometer = dataclasses.asdict(instrument)
    check_seed(interferometer.pop("seed"))
    observed_as(interferometer.pop("observation"), "m")
    Interferometer(**interferometer)
    return choice, x0


def simulated(run: Run, choice: "Choice", x0: float, instrument: Instrument) -> "tuple[Motion, Record, dict[str, Any]]":
    """Return the motion, its record, and facts about both."""
    import numpy as np

    from ..instrument import synthetic_run
    from ..oscillator import RESULTS, is_successful
    from ..oscillator import simulate as integrate

    oscillator = choice.oscillator
    duration = _duration(oscillator, x0, run) if run.duration is None else run.duration
    record = synthetic_run(
        oscillator,
        x0,
        rate=run.rate,
        duration=duration,
        v0=run.v0,
        hold=run.hold,
        release_time_constant=run.release_time_constant,
        floor_acceleration_psd=run.floor_acceleration_psd,
        **dataclasses.asdict(instrument),
    )
    # The motion without the imperfections of instrument, floor and release.
    times = np.asarray(record.trace.t)
    times = times[times >= run.hold] - run.hold
    motion = integrate(oscillator, x0, times, v0=run.v0, engine=choice.engine, accuracy=run.accuracy)
    if not is_successful(motion.result):
        raise UsageError(f"The motion could not be computed: {RESULTS[motion.result]}")
    return motion, record, _facts(motion, record, run)


def _duration(oscillator: "Oscillator", x0: float, run: Run) -> float:
    """Return the time until the mass rests, plus a short tail [s].

    A mass without damping rests last, so the search covers the motion without damping.
    """
    import numpy as np

    from ..oscillator import simulate as integrate

    band, omega = float(oscillator.dead_band), float(oscillator.angular_frequency)
    stop = math.inf
    if oscillator.friction.set_valued and band > 0:
        # Each half-cycle reduces the amplitude by two dead bands or more. Follow the motion for twice that time.
        half_cycles = math.hypot(x0, run.v0 / omega) / (2 * band) + 4
        stop = float(integrate(oscillator, x0, np.array([2 * half_cycles * math.pi / omega]), v0=run.v0).t_stop)
    if not math.isfinite(stop):
        raise UsageError("Under this law the mass does not come to rest: say with --duration how long to watch.")
    return run.hold + stop + _TAIL


def _facts(motion: "Motion", record: "Record", run: Run) -> dict[str, Any]:
    stop = float(motion.t_stop)
    rests = bool(motion.at_rest[-1])
    return {
        "schema": "fricjax.simulate/1",
        "engine": motion.engine,
        "samples": record.trace.n,
        "rate": run.rate,
        "duration": record.trace.n / run.rate,
        "n_half_cycles": int(motion.n_half_cycles),
        "t_stop": stop if rests else None,
        "final_displacement": float(motion.x[-1]) if rests else None,
        "regularisation_bias": float(motion.regularisation_bias),
        "undisturbed": run.release_time_constant == 0 and run.floor_acceleration_psd == 0,
        "coefficients": record.meta["coefficients"],
    }


def _text(facts: dict[str, Any], unit: str) -> str:
    from ..show import engineering

    rests, ideal = facts["t_stop"] is not None, "" if facts["undisturbed"] else " (without release and floor motion)"
    rows = {
        "engine": facts["engine"],
        "samples": f"{facts['samples']} at {facts['rate']:g} Hz, {facts['duration']:.6g} s",
        "half-cycles": f"{facts['n_half_cycles']}" + ("" if rests else ", still moving at the end") + ideal,
    }
    if rests:
        rows["stop"] = f"{facts['t_stop']:.9g} s after the release{ideal}"
        rows["final position"] = f"{facts['final_displacement']:.9g} {unit}{ideal}"
    if facts["regularisation_bias"]:
        rows["bias"] = f"{engineering(facts['regularisation_bias'], unit)} at most, of the regularised law"
    return "\n".join(f"{name:<16}{value}" for name, value in rows.items())


def _picture(motion: "Motion", record: "Record") -> Any:
    """Draw displacement and friction force over time."""
    import numpy as np

    from ..show import axis_label, display_unit, figure, rotary_unit

    drawing, axes = figure(2, 1, share_x=True, heights=(3, 2))
    top, bottom = axes[:, 0]
    t, x, force = np.asarray(record.trace.t), np.asarray(record.trace.x), np.asarray(motion.friction_force)
    factor, unit = display_unit(float(np.max(np.abs(x))), record.quantity)
    top.plot(t, factor * x)
    stop = float(motion.t_stop)
    if stop <= t[-1]:
        top.axvspan(stop, t[-1], color="0.92", zorder=0, label=f"at rest from {stop:.6g} s")
        top.legend(loc="upper right", fontsize=8)
    top.set_ylabel(axis_label(record.observation.name, unit))
    factor, unit = display_unit(float(np.max(np.abs(force))), rotary_unit("N", record.observation.motion))
    bottom.plot(np.asarray(motion.t), factor * force, color="#D55E00")
    bottom.set_ylabel(axis_label("Friction force", unit))
    bottom.set_xlabel(axis_label("Time", "s"))
    return drawing
