"""Recover known coefficients from velocities, accelerations and films.

Each sensor watches machines of random frequency, damping, friction and amplitude, with random bias and drift. The same
motion is also read as a displacement. The script prints for each sensor the number of converged fits, the rms of the
errors of mu, damping and stiffness in their standard errors, the largest one, the share of 95 % intervals that cover,
the rms of the differences from the displacement in their standard error, and the median time of a fit.

The gyroscope is that of a phone on a pendulum: 100 Hz, noise of 3 mrad/s.

    python experiments/observation/run.py [--records 100] [--only gyroscope]
"""

import argparse
import math
import time
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

import fricjax as fj  # noqa: E402

FREE = ("mu", "damping", "stiffness")
COVERAGE = 1.96


class Sensor(NamedTuple):
    """A sensor with its machine.

    Attributes:
        observation: the map from the motion to the reading.
        frequency: range of the natural frequency [Hz]; `amplitude`: range of the displacement at release [m or rad].
        rate: samples per second.
        noise: of a sample; `offset`, `drift`: largest bias and drift, in the unit of the reading.
        displacement: noise of the displacement sensor that watches the same motion [m or rad].
    """

    observation: fj.Observation
    frequency: tuple[float, float]
    amplitude: tuple[float, float]
    rate: float
    noise: float
    offset: float
    drift: float
    displacement: float


SENSORS = {
    "gyroscope": Sensor(fj.Observation("velocity", "rad"), (0.5, 2), (0.2, 0.6), 100.0, 3e-3, 0.05, 1e-3, 1e-3),
    "vibrometer": Sensor(fj.Observation("velocity"), (5, 15), (1e-3, 3e-3), 5e3, 1e-5, 1e-4, 1e-5, 1e-7),
    "accelerometer": Sensor(fj.Observation("acceleration"), (1, 4), (0.02, 0.1), 400.0, 2e-2, 0.3, 1e-3, 1e-5),
    "camera": Sensor(fj.Observation("projection", length=0.42), (0.5, 1.2), (0.2, 0.6), 60.0, 5e-4, 0.5, 0.0, 1e-3),
}


class Case(NamedTuple):
    """One motion, its reading, and the same as a displacement."""

    machine: fj.Oscillator
    true: dict[str, float]
    record: fj.Record
    displacement: fj.Record


def case(sensor: Sensor, seed: int) -> Case:
    """Draw a machine and simulate both records.

    The decay takes 15 to 60 half-cycles, and the record ends before or after the stop.
    """
    draw = np.random.default_rng(seed)
    omega = 2 * math.pi * float(draw.uniform(*sensor.frequency))
    x0, half_cycles = float(draw.uniform(*sensor.amplitude)), float(draw.uniform(15, 60))
    # Damping and dry friction share the decay: e^(-zeta pi n) of it is left when friction alone stops the mass.
    ratio = float(draw.uniform(0.1, 0.6)) / (math.pi * half_cycles)
    band = x0 / (2 * half_cycles) * float(draw.uniform(0.4, 1.0))
    true = {"mu": band * omega**2, "damping": 2 * ratio * omega, "stiffness": omega**2}
    spring = fj.restoring.Pendulum() if sensor.observation.motion == "rad" else fj.restoring.Linear()
    law = fj.friction.Coulomb(true["mu"])
    machine = fj.Oscillator(1.0, true["stiffness"], true["damping"], 1.0, law, restoring=spring)
    duration = math.pi / omega * half_cycles * float(draw.uniform(0.6, 1.6))
    offset, drift = (float(draw.uniform(-1, 1)) * size for size in (sensor.offset, sensor.drift))
    common = {"rate": sensor.rate, "duration": duration, "seed": seed}
    record = fj.synthetic_run(
        machine, x0, observation=sensor.observation, noise=sensor.noise, offset=offset, drift=drift, **common
    )
    displacement = fj.synthetic_run(machine, x0, noise=sensor.displacement, **{**common, "seed": seed + 1_000_000})
    # The noise is estimated from the samples, as in a measured record.
    bare = [fj.Record(fj.Trace(each.t, each.x), each.meta) for each in (record, displacement)]
    return Case(machine, true, *bare)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--records", type=int, default=100, help="records of each sensor")
    parser.add_argument("--only", default="", help="name of a sensor")
    options = parser.parse_args()
    print("sensor         converged    rms z of mu, damping, stiffness  largest  covered  rms z of difference  time")
    for name, sensor in SENSORS.items():
        if options.only in name:
            print(row(name, sensor, options.records), flush=True)


def row(name: str, sensor: Sensor, records: int) -> str:
    """Fit all records of a sensor; return a line of the table."""
    errors, differences, times, converged = [], [], [], 0
    for seed in range(records):
        each = case(sensor, seed)
        begin = time.perf_counter()
        fit = fj.fit(each.record, each.machine, FREE, throw=False)
        times.append(time.perf_counter() - begin)
        other = fj.fit(each.displacement, each.machine, FREE, throw=False)
        if not fit.converged:
            print(f"{name} {seed}: {fit.status}")
            continue
        converged += 1
        errors.append([(fit.values[key] - each.true[key]) / fit.std_errors[key] for key in FREE])
        if other.converged:
            std = [math.hypot(fit.std_errors[key], other.std_errors[key]) for key in FREE]
            apart = [fit.values[key] - other.values[key] for key in FREE]
            differences.append(np.divide(apart, std))
    z, d = np.array(errors), np.array(differences)
    rms = lambda values: "  ".join(f"{size:.2f}" for size in np.sqrt(np.mean(values**2, axis=0)))
    return (
        f"{name:<15}{converged:>4} of {records:<4}{rms(z):>24}{np.abs(z).max():>16.2f}"
        f"{100 * np.mean(np.abs(z) < COVERAGE):>7.0f} %{rms(d):>21}{1e3 * float(np.median(times)):>7.0f} ms"
    )


if __name__ == "__main__":
    main()
