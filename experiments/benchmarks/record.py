"""A record with its true values, and its file for worker processes."""

import dataclasses
from pathlib import Path

import numpy as np
from rig import DAMPING, SIGMA0, STIFFNESS

# The standard start, in units of the true values. x0 starts at the first sample, the offset at zero.
START = {"mu": 0.8, "damping": 1.2, "stiffness": 1.0005}


@dataclasses.dataclass(frozen=True, eq=False)
class Record:
    """A noisy free decay from rest.

    Attributes:
        law: "coulomb", "tanh" or "lugre".
        t, x: evenly spaced times [s] and measured displacements [m], shape (n,).
        mu, x0: true coefficient of friction [1] and initial displacement [m].
        half_cycles: number of half-cycles to the rest under Coulomb friction; a million if the record ends in motion.
    """

    law: str
    t: np.ndarray
    x: np.ndarray
    mu: float
    x0: float
    half_cycles: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        extra = ("sigma0", "x0") if self.law == "lugre" else ("x0", "offset")
        return ("mu", "damping", "stiffness", *extra)

    @property
    def truth(self) -> dict[str, float]:
        return truth(self.mu, self.x0)

    @property
    def start(self) -> dict[str, float]:
        """Standard start values, also of the fixed parameters."""
        known = self.truth | {"x0": float(self.x[0])}
        return {name: value * START.get(name, 1.0) for name, value in known.items()}


def truth(mu: float, x0: float) -> dict[str, float]:
    return {"mu": mu, "damping": DAMPING, "stiffness": STIFFNESS, "sigma0": SIGMA0, "x0": x0, "offset": 0.0}


def save(records: list[Record], path: Path) -> Path:
    """Write records with a common law and common times."""
    columns = {name: [getattr(r, name) for r in records] for name in ("x", "mu", "x0", "half_cycles")}
    np.savez(path, law=records[0].law, t=records[0].t, **columns)  # pyright: ignore[reportArgumentType]
    return path


def load(path: Path) -> list[Record]:
    with np.load(path) as file:
        law, t = str(file["law"]), file["t"]
        rows = zip(file["x"], file["mu"], file["x0"], file["half_cycles"], strict=True)
        return [Record(law, t, x, float(mu), float(x0), int(n)) for x, mu, x0, n in rows]
