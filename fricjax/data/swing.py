"""A trace made ready for the search of its reversals: its samples, smoothed ones, and the scales that matter."""

import dataclasses

import numpy as np


@dataclasses.dataclass(frozen=True)
class Swing:
    """Samples of a decay with the scales of its noise and its time.

    **Fields:**

    - `t`, `x`: times [s] and positions of the used samples, shape `(n,)`; `smoothed`: positions with less noise.
    - `noise`: standard deviation of `x`; `threshold`: the smallest motion that counts as one.
    - `half_period`: typical duration of a stroke [s].
    """

    t: np.ndarray
    x: np.ndarray
    smoothed: np.ndarray
    noise: float
    threshold: float
    half_period: float

    @property
    def interval(self) -> float:
        """Typical time between samples [s]."""
        return float(np.median(np.diff(self.t)))

    def moved(self, begin: int, end: int, share: float) -> float:
        """Displacement, in the direction from sample `begin` to `end`, a share of the half-period after `begin`."""
        place = min(int(np.searchsorted(self.t, self.t[begin] + share * self.half_period)), self.x.size - 1)
        return float((self.smoothed[place] - self.smoothed[begin]) * np.sign(self.smoothed[end] - self.smoothed[begin]))

    def stroke(self, begin: int, end: int) -> float:
        """Distance between two samples."""
        return float(abs(self.smoothed[end] - self.smoothed[begin]))
