"""Machines of the paper, and results of studies.

The text extracted from the paper has no digit 0 and no stiffness of the simulation. With mu = 0.1 and m = 1 kg the
printed final displacements and the axis of Fig. 4 imply k = 5000 N/m and g = 9.81 m/s^2.
"""

import csv
import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

import fricjax as fj

STIFFNESS, MASS, LOAD, MU = 5000.0, 1.0, 9.81, 0.1
PROTOTYPE_STIFFNESS, PROTOTYPE_FREQUENCY, PROTOTYPE_DAMPING_RATIO = 2574.0, 12.6, 0.0027
PROTOTYPE_MASS = PROTOTYPE_STIFFNESS / (2 * math.pi * PROTOTYPE_FREQUENCY) ** 2


def oscillator(
    mass: float, stiffness: float, damping_ratio: float, load: float, mu: Any, mu_s: Any = None
) -> fj.Oscillator:
    """Build a machine from its damping ratio [1], under Coulomb friction."""
    damping = 2 * damping_ratio * math.sqrt(stiffness * mass)
    return fj.Oscillator(mass, stiffness, damping, load, fj.friction.Coulomb(mu, mu_s))


def simulated_machine(damping_ratio: float = 0.0, mu: float = MU, mu_s: float | None = None) -> fj.Oscillator:
    """Build the machine of the paper's simulations."""
    return oscillator(MASS, STIFFNESS, damping_ratio, LOAD, mu, mu_s)


def prototype(load: float, mu: Any) -> fj.Oscillator:
    """Build the machine of the paper's experiments, from its impact test."""
    return oscillator(PROTOTYPE_MASS, PROTOTYPE_STIFFNESS, PROTOTYPE_DAMPING_RATIO, load, mu)


@dataclasses.dataclass(frozen=True)
class Number:
    """A number of fricjax with its reference.

    Attributes:
        quantity: name of the quantity.
        unit: SI unit of all values.
        ours: computed by fricjax.
        reference: from the closed form.
        printed: as the paper prints it, with its zeros restored; None if the paper prints none.
    """

    quantity: str
    unit: str
    ours: float
    reference: float
    printed: float | None = None


@dataclasses.dataclass(frozen=True)
class Study:
    """Results of one study.

    Attributes:
        title: a heading.
        note: assumptions, and the main observation.
        numbers: numbers of fricjax with their references.
        columns: data of the plot, by names with units; all of one length.
        picture: a matplotlib figure.
    """

    title: str
    note: str
    numbers: Sequence[Number]
    columns: Mapping[str, Any]
    picture: Any


def write(study: Study, name: str, folder: Path) -> list[Path]:
    """Write plot and columns, and return the paths of both files."""
    table = folder / f"{name}.csv"
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(study.columns)
        writer.writerows(zip(*(np.asarray(column).tolist() for column in study.columns.values()), strict=True))
    return [fj.show.save(study.picture, folder / f"{name}.png", overwrite=True), table]
