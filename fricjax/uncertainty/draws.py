"""Drawn values of the parameters of a fit: scatter, intervals and histograms."""

import abc
import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..show import Reported, Style, axis_label, figure, styled
from ..show.thumbnail import bars_svg


@dataclasses.dataclass(frozen=True, eq=False)
class AbstractDraws(Reported):
    """Drawn values of the parameters of a fit, and the fit.

    Attributes:
        names: free parameters; `units`: by name.
        sample: draws; the last axis is that of the parameters.
        values, std_errors: values and standard errors of the fit, by name.
    """

    names: tuple[str, ...]
    units: dict[str, str]
    sample: np.ndarray
    values: dict[str, float]
    std_errors: dict[str, float]

    @property
    @abc.abstractmethod
    def good(self) -> np.ndarray:
        """The valid draws, shape (n, p)."""

    @property
    def std(self) -> dict[str, float]:
        """Standard deviation of each parameter over the draws."""
        return dict(zip(self.names, self.good.std(axis=0, ddof=1).tolist(), strict=True))

    def intervals(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Return intervals with equal fractions of the draws beyond both ends."""
        ends = np.quantile(self.good, [(1 - level) / 2, (1 + level) / 2], axis=0)
        return {name: (float(low), float(high)) for name, low, high in zip(self.names, *ends, strict=True)}

    def thumbnails(self) -> Sequence[str]:
        std = self.std
        ratios = [std[name] / self.std_errors[name] if self.std_errors[name] else math.nan for name in self.names]
        return [bars_svg(self.names, ratios, "Scatter of the draws over the standard error")]

    def plot(self, *, style: Style = "screen") -> Any:
        """Draw histograms with the normal distributions of the standard errors, in matplotlib.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure(math.ceil(len(self.names) / 2), 2)
        at = np.linspace(-4, 4, 200)
        for axis, name, values in zip(axes.flat, self.names, self.good.T, strict=False):
            axis.hist((values - self.values[name]) / self.std_errors[name], bins=40, density=True, color="#B8D4E8")
            axis.plot(at, np.exp(-(at**2) / 2) / math.sqrt(2 * math.pi), color="#D55E00")
            axis.set_xlabel(axis_label(f"{name} less its value, in standard errors", ""))
        for axis in axes.flat[len(self.names) :]:
            axis.set_visible(False)
        return styled(drawing, style)
