"""Tables of runs as in an archive, from closed forms.

The runs have Coulomb and viscous friction on a linear spring.
"""

import hashlib

import numpy as np
import pandas as pd

MASS, STIFFNESS, DAMPING_RATIO = 0.41, 2574.0, 0.0027
OMEGA = (STIFFNESS / MASS) ** 0.5
HALF = np.pi / (OMEGA * (1 - DAMPING_RATIO**2) ** 0.5)
REJECTED = (
    "The file runs/run-{0:05d}.csv has no column 'x2': it has 't', 'x'. Name it with column=.",
    "Row {0} of runs/run-{0:05d}.csv is no number: '#REF!'.",
    "The record has 2 half-cycles, too few to be fitted.",
)


def decay(mu, load, x0, n=256):
    """Times, displacements and reversals of a decay, including the stop."""
    band = mu * load / STIFFNESS
    rho = np.exp(-np.pi * DAMPING_RATIO / np.sqrt(1 - DAMPING_RATIO**2))
    points = [x0]
    while abs(points[-1]) > band:
        side = np.sign(points[-1])
        points.append(side * (band - rho * (abs(points[-1]) - band)))
    points = np.array(points)
    t = np.linspace(0, 1.2 * HALF * (points.size - 1), n)
    number = np.minimum((t / HALF).astype(int), points.size - 1)
    phase = np.where(number < points.size - 1, (t - number * HALF) / HALF, 0.0)
    after = points[np.minimum(number + 1, points.size - 1)]
    x = (points[number] + after) / 2 + (points[number] - after) / 2 * np.cos(np.pi * phase)
    return t, x, HALF * np.arange(points.size), points


def archive(runs=60, *, seed=0, broken=0.1):
    """Table with the columns of an archive.

    A share `broken` of the runs cannot be fitted or is unreliable.
    """
    generator = np.random.default_rng(seed)
    rows = [_row(i, generator, generator.random() < broken) for i in range(runs)]
    return pd.DataFrame(rows)


def _row(i, generator, bad):
    load = (5.0, 10.0, 20.0)[i % 3]
    row = {
        "key": hashlib.sha256(str(i).encode()).hexdigest(),
        "file": f"runs/run-{i:05d}.csv",
        "run": "",
        "friction": "coulomb",
        "status": "ok",
        "outcome": "converged",
        "warnings": "",
    }
    if bad and i % 2:
        return row | {"status": "rejected", "outcome": REJECTED[i % 3].format(i), "quantity": "m"}
    mu = 0.02 + 3e-4 * generator.standard_normal()
    if bad:
        row |= {"status": "invalid", "outcome": f"at a bound: mu ended at {mu:.3g}", "warnings": "The rest is short."}
    t, x, reversal_t, reversal_x = decay(mu, load, 2e-3 * generator.uniform(0.5, 1.0))
    for name, value, std in (
        ("mu", mu, 1e-6),
        ("damping", 0.176, 3e-5),
        ("natural_frequency", OMEGA / 2 / np.pi, 3e-7),
        ("damping_ratio", DAMPING_RATIO, 4e-8),
        ("dead_band", mu * load / STIFFNESS, 4e-10),
    ):
        row |= {name: value, f"{name}_std": std, f"{name}_combined_std": np.hypot(std, 2e-3 * value)}
    noise = 5e-9
    return row | {
        "chi2_reduced": generator.uniform(0.9, 1.1),
        "residual_rms": noise,
        "sigma": noise,
        "numerical_shift": 2e-7,
        "half_cycles": reversal_t.size - 1,
        "engine": "exact",
        "quantity": "m",
        "samples": 4000,
        "rate": 5000.0,
        "duration": t[-1],
        "amplitude": abs(reversal_x[0]),
        "measured_at": f"2026-0{1 + i % 9}-{1 + i % 28:02d}T{i % 24:02d}:15:00+00:00",
        "load": load,
        "rig": "rig.toml",
        "lubricant": ("none", "oil")[i % 2],
        "sketch_t": t.astype("f4"),
        "sketch_x": x.astype("f4"),
        "sketch_residual": (noise * generator.standard_normal(t.size)).astype("f4"),
        "reversal_t": reversal_t.astype("f4"),
        "reversal_x": reversal_x.astype("f4"),
        "sha256": row["key"],
        "fricjax": "0.1.0",
        "host": "bench",
    }
