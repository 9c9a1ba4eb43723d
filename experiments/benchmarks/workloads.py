"""Standard records by name, with fixed seeds, and chi^2 of their fits."""

from collections.abc import Mapping

import numpy as np
import reference
from record import Record, truth
from rig import MU, NOISE, X0

RATE, DURATION = 5e3, 2.0


def record(
    law: str, *, mu: float = MU, x0: float = X0, rate: float = RATE, duration: float = DURATION, seed: int = 0
) -> Record:
    """Make a record of the prototype rig under one of three laws."""
    t = np.arange(round(rate * duration)) / rate
    half_cycles = reference.half_cycles(truth(mu, x0), duration)
    noise = NOISE * np.random.default_rng(seed).standard_normal(t.size)
    return Record(law, t, noise + reference.displacement(law, t, truth(mu, x0), half_cycles), mu, x0, half_cycles)


def archive(law: str, runs: int, *, rate: float = RATE, duration: float = DURATION) -> list[Record]:
    """Make runs with random friction and initial displacement."""
    random = np.random.default_rng(1)
    mu, x0 = random.uniform(0.005, 0.02, runs), random.uniform(0.5e-3, 3e-3, runs)
    return [record(law, mu=mu[i], x0=x0[i], rate=rate, duration=duration, seed=2 + i) for i in range(runs)]


def chi2(record: Record, values: Mapping[str, float]) -> float:
    """Compute chi^2 of fitted values by the reference solution.

    All methods are thus judged by the same model.
    """
    found = reference.displacement(record.law, record.t, record.start | dict(values), record.half_cycles)
    return float(np.sum(((record.x - found) / NOISE) ** 2))
