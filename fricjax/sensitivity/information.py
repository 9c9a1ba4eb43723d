"""Information of a planned run: expected standard errors, correlations and advice."""

import dataclasses
import functools
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..estimation.covariance import correlation
from ..fitting.names import NUISANCES
from ..oscillator import Oscillator
from ..rig import Measured
from ..show import Cell, Report, Reported, Style, Table, axis_label, duration, engineering, figure, styled
from ..show.thumbnail import bars_svg
from .directions import Direction
from .plan import PlannedMotion

# Rounding error of the change of a quantity along an undetermined direction, as a fraction of its terms.
_ROUNDING = 1e-6


@dataclasses.dataclass(frozen=True, eq=False)
class Information(Reported):
    """Information of a planned run about its parameters.

    Attributes:
        names: coefficients and then nuisances of the run, in the order of all matrices.
        values, units: by name, SI.
        matrix: Fisher information, in the inverse units of the parameters, shape (p, p).
        inverse: its generalised inverse, the expected covariance of the determined directions, shape (p, p).
        rank: number of directions among the parameters that the run determines.
        condition: condition number of the derivatives, each scaled to unit length, without those of `no_effect`; inf
            if a direction is undetermined.
        singular: undetermined directions, each in words.
        no_effect: parameters on which the motion does not depend at all.
        slopes: quantities that need no rig, each with its value, its unit and its derivatives by name.
        motion: turning points and stop of the planned motion.
        x0: displacement at release [m].
        samples, rate, duration, noise: of the planned record [1], [1/s], [s], [m].
        engine: name of the engine.
        oscillator: the machine.
        combinations: combinations of a static coefficient and a Stribeck velocity. A run often determines the two only
            together.
        errors: reasons in sentences why a fit would not be valid, with a remedy: parameters without effect and
            undetermined directions.
        warnings: advice on the run, in sentences.

    Examples:
        >>> import fricjax as fj
        >>> oscillator = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> information = fj.sensitivity.fisher(oscillator, 1e-3, names=["mu", "stiffness"])
        >>> information.undetermined, information.motion.half_cycles
        ((), 3)
        >>> dead_band = information.kinematics["dead_band"]
        >>> print(f"{dead_band.value:.4g} {dead_band.unit} to {dead_band.std:.0e}")
        0.0001876 m to 2e-11
    """

    names: tuple[str, ...]
    values: dict[str, float]
    units: dict[str, str]
    matrix: np.ndarray
    inverse: np.ndarray
    rank: int
    condition: float
    singular: tuple[Direction, ...]
    no_effect: tuple[str, ...]
    slopes: Mapping[str, tuple[float, str, Mapping[str, float]]]
    motion: PlannedMotion
    x0: float
    samples: int
    rate: float
    duration: float
    noise: float
    engine: str
    oscillator: Oscillator
    combinations: dict[str, Measured] = dataclasses.field(default_factory=dict)
    errors: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def std_of(self, derivatives: Mapping[str, float]) -> float:
        """Return the expected standard error of a quantity; inf if undetermined.

        Args:
            derivatives: derivative of the quantity with respect to each parameter, by name.
        """
        slope = np.array([derivatives.get(name, 0.0) for name in self.names])
        for direction in self.singular:
            change = np.array([slope[self.names.index(name)] for name in direction.names]) * direction.changes
            if abs(change.sum()) > _ROUNDING * np.abs(change).sum():
                return np.inf
        if any(derivatives.get(name) for name in self.no_effect):
            return np.inf
        return float(np.sqrt(max(slope @ self.inverse @ slope, 0.0)))

    @functools.cached_property
    def std_errors(self) -> dict[str, float]:
        """Expected standard errors by name; inf for an undetermined parameter."""
        return {name: self.std_of({name: 1.0}) for name in self.names}

    @property
    def undetermined(self) -> tuple[str, ...]:
        """Parameters that the run does not determine."""
        return tuple(name for name in self.names if not np.isfinite(self.std_errors[name]))

    @property
    def covariance(self) -> np.ndarray:
        """Expected covariance, inf for undetermined parameters, shape (p, p)."""
        matrix, lost = self.inverse.copy(), ~np.isfinite(list(self.std_errors.values()))
        matrix[lost, :] = matrix[:, lost] = 0.0
        matrix[lost, lost] = np.inf
        return matrix

    @property
    def correlation(self) -> np.ndarray:
        """Expected correlation matrix, NaN for undetermined parameters, shape (p, p)."""
        matrix, lost = correlation(self.covariance), ~np.isfinite(list(self.std_errors.values()))
        matrix[lost, :] = matrix[:, lost] = np.nan
        return matrix

    def correlation_of(self, first: str, second: str) -> float:
        """Return the expected correlation of two parameters; NaN if undetermined."""
        return float(self.correlation[self.names.index(first), self.names.index(second)])

    @property
    def kinematics(self) -> dict[str, Measured]:
        """Natural frequency, damping ratio, dead band, and losses per unit mass.

        These quantities need no rig.
        """
        return {name: Measured(value, self.std_of(by), unit) for name, (value, unit, by) in self.slopes.items()}

    def __repr__(self) -> str:
        errors = ", ".join(f"{name}: {std:.2g}" for name, std in self.std_errors.items())
        return f"Information(expected standard errors: {errors})"

    def report(self) -> Report:
        """Return the expected errors, the planned run and advice."""
        names = ("names", "values", "units", "std_errors", "covariance", "correlation", "rank", "condition")
        record = ("x0", "samples", "rate", "duration", "noise", "engine")
        data = {
            **{name: getattr(self, name) for name in names},
            "undetermined": self.undetermined,
            "singular": [{"names": d.names, "changes": d.changes, "text": d.text} for d in self.singular],
            "no_effect": self.no_effect,
            "errors": self.errors,
            "remarks": self.warnings,
            "kinematics": self.kinematics,
            "combinations": self.combinations,
            "n_half_cycles": self.motion.half_cycles,
            "t_stop": self.motion.t_stop,
            "dead_band": float(self.oscillator.dead_band),
            **{name: getattr(self, name) for name in record},
        }
        shown = {"warnings": self.warnings, "errors": self.errors, "heading": "Planned run"}
        return Report(self._tables(), self._facts(), **shown, data=data)

    def _tables(self) -> list[Table]:
        """Return the tables of parameters, quantities without a rig, and correlations."""
        rows = []
        for name in self.names:
            value, std, unit = self.values[name], self.std_errors[name], self.units[name]
            note = "no effect" if name in self.no_effect else "" if np.isfinite(std) else "undetermined"
            rows.append([name, *_cells(Measured(value, std, unit)), note])
        known = {**{name.replace("_", " "): each for name, each in self.kinematics.items()}, **self.combinations}
        lost, matrix = self.undetermined, self.correlation
        index = [i for i, name in enumerate(self.names) if name not in lost and name not in NUISANCES]
        correlations = [[self.names[i], *(f"{matrix[i, j]:.3f}" for j in index)] for i in index]
        return [
            Table(["Parameter", "Expected", "Standard error", "Relative", "Remarks"], rows),
            Table(
                ["Without a rig", "Expected", "Standard error", "Relative"],
                [[name, *_cells(estimate)] for name, estimate in known.items()],
            ),
            Table(["Correlation", *(self.names[i] for i in index)], correlations),
        ]

    def _facts(self) -> list[tuple[str, str]]:
        """Return the lines below the tables."""
        band, motion, rest = float(self.oscillator.dead_band), self.motion, "no stop"
        about = "about " if motion.like_coulomb else ""
        if motion.half_cycles is not None:
            count = "1 half-cycle" if motion.half_cycles == 1 else f"{motion.half_cycles} half-cycles"
            rest = f"{about}{count}, stop {about}{duration(motion.t_stop)} after the release"
        away = f", {abs(self.x0) / band:.3g} dead bands of {engineering(band, 'm')}" if band else ""
        noise = engineering(self.noise, "m")
        record = f"{self.samples} samples at {self.rate:g} Hz, {duration(self.duration)}, white noise of {noise}"
        return [
            ("release", f"from {engineering(self.x0, 'm')}{away}"),
            ("motion", f"{rest}, {self.engine} engine"),
            ("record", record),
            ("rank", f"{self.rank} of {len(self.names)}, condition {self.condition:.2g}"),
            ("bound", "standard errors are those of white noise alone; they go with noise/sqrt(rate)"),
        ]

    def thumbnails(self) -> Sequence[str]:
        shown = [name for name in self.names if name not in NUISANCES and self.values[name]]
        shares = [100 * self.std_errors[name] / abs(self.values[name]) for name in shown]
        return [bars_svg(shown, shares, "Expected standard error [% of the value]; none: undetermined")]

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw relative standard errors and the correlations, in matplotlib.

        Nuisances in metres are relative to the release. Undetermined parameters stay empty.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure(1, 2)
        left, right = axes[0]
        names, rows = self.names, range(len(self.names))
        sizes = [abs(self.values[name]) or (abs(self.x0) if self.units[name] == "m" else 1.0) for name in names]
        shares = np.array([self.std_errors[name] / size for name, size in zip(names, sizes, strict=True)])
        left.barh(rows, np.where(np.isfinite(shares), shares, 0.0))
        if np.any(np.isfinite(shares)):
            left.set_xscale("log")
        left.set_xlabel(axis_label("Standard error over size", "1"))
        shown = right.imshow(self.correlation, vmin=-1, vmax=1, cmap="RdBu_r")
        right.set_xticks(rows, names, rotation=90)
        for axis in (left, right):
            axis.set_yticks(rows, names)
        left.invert_yaxis()
        right.grid(False)
        bar = drawing.colorbar(shown, ax=right)
        bar.set_label(axis_label("Correlation", "1"), fontsize=9)
        bar.ax.tick_params(labelsize=9)
        run = f"Released from {engineering(self.x0, 'm')}, noise {engineering(self.noise, 'm')} at {self.rate:g} Hz"
        lost = f"undetermined: {', '.join(self.undetermined)}" if self.undetermined else "all determined"
        drawing.suptitle("\n".join([run, *textwrap.wrap(lost, 100)]), fontsize=9)
        return styled(drawing, style)


def _cells(estimate: Measured) -> list[Cell]:
    """Return cells for value, standard error and their ratio."""
    value, std, unit = estimate.value, estimate.std, estimate.unit or ""
    texts = [engineering(*pair) if np.isfinite(pair[0]) else "" for pair in ((value, unit, 6), (std, unit, 2))]
    ratio = f"{std / abs(value):.2g}" if value and np.isfinite(std) else ""
    relative = Cell(ratio, relative_std=estimate.relative, unit=unit)
    return [Cell(texts[0], value=value), Cell(texts[1], std=std), relative]
