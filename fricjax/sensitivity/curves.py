"""Derivatives of the reading with respect to each parameter, over a run."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import ArrayLike

from ..fitting.names import NUISANCES, find_leaf
from ..oscillator import Oscillator
from ..oscillator.engines import AbstractEngine
from ..oscillator.oscillator import leaves_of
from ..show import Cell, Report, Reported, Style, Table, axis_label, engineering, figure, plain, scaled, styled
from .local import local


@dataclasses.dataclass(frozen=True, eq=False)
class Curves(Reported):
    """Derivatives of the reading with respect to each parameter, against time.

    Attributes:
        names: parameters, in order.
        t: times [s], shape (samples,).
        absolute: dx/d(parameter), metres per SI unit of each, shape (samples, p).
        relative: dimensionless derivatives, shape (samples, p): change of the reading over the release, per relative
            change of a parameter. A position of zero is relative to the release.
        x0: displacement at release [m].

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> found = fj.sensitivity.curves(machine, 1e-3, [0.0, 0.02, 0.04], ["mu", "x0"])
        >>> found.relative.shape, float(found.relative[0, 1])
        ((3, 2), 1.0)
    """

    names: tuple[str, ...]
    t: np.ndarray
    absolute: np.ndarray
    relative: np.ndarray
    x0: float

    def report(self) -> Report:
        """Return the largest dimensionless derivative of each parameter and its time."""
        largest = np.argmax(np.abs(self.relative), axis=0)
        rows = []
        for i, (name, at) in enumerate(zip(self.names, largest, strict=True)):
            peak, t = float(self.relative[at, i]), float(self.t[at])
            rms = float(np.sqrt(np.mean(self.relative[:, i] ** 2)))
            cells = Cell(plain(peak, 3), largest=peak), Cell(engineering(t, "s", 3), t=t), Cell(plain(rms, 3), rms=rms)
            rows.append([name, *cells])
        heads = ["Parameter", "Largest", "At", "Root mean square"]
        facts = [("release", engineering(self.x0, "m", 4)), ("unit", "parts of the release per part of the parameter")]
        data = {name: getattr(self, name) for name in ("names", "t", "absolute", "relative", "x0")}
        return Report([Table(heads, rows, "Sensitivity over the run", {"t": "s"})], facts, data=data)

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw dimensionless derivatives against time, in matplotlib.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure(len(self.names), share_x=True)
        times, unit = scaled(self.t, "s")
        for axis, name, column in zip(axes[:, 0], self.names, self.relative.T, strict=True):
            axis.plot(times, column)
            axis.set_ylabel(axis_label(name, "1"))
        axes[-1, 0].set_xlabel(axis_label("Time", unit))
        drawing.suptitle("Change of the reading over the release, per relative change of each", fontsize=9)
        return styled(drawing, style)


def curves(
    oscillator: Oscillator, x0: float, ts: ArrayLike, names: Sequence[str], *, engine: str | AbstractEngine = "auto"
) -> Curves:
    """Return derivatives of the reading over a run.

    Args:
        oscillator: the machine.
        x0: displacement at release [m].
        ts: times to sample at, increasing [s], shape (samples,).
        names: coefficients and nuisances, see :func:`local`.
        engine: see :func:`local`.

    Returns:
        The absolute and dimensionless derivatives against time.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: see :func:`local`.

    Examples:
        >>> import fricjax as fj
        >>> machine = fj.Oscillator(0.41, 2574.0, 0.18, 9.66, fj.friction.Coulomb(0.05))
        >>> print(fj.sensitivity.curves(machine, 1e-3, [0.0, 0.02, 0.04], ["mu", "x0"]).names)
        ('mu', 'x0')
    """
    absolute = local(oscillator, x0, ts, names, engine=engine)
    leaves, values = leaves_of(oscillator), jax.tree.leaves(oscillator)
    sizes = []
    for name in names:
        value = 0.0 if name in NUISANCES else float(values[find_leaf(name, leaves).index])
        sizes.append(abs(value) or (abs(x0) if NUISANCES.get(name) == "m" else 1.0))
    return Curves(tuple(names), np.asarray(ts, float), absolute, absolute * sizes / abs(x0), float(x0))
