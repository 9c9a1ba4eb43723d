"""Result of a simulation: motion, turning points and statistics."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int

from ..friction.base import Scalar, State
from ..show import Report, Reported, Style, axis_label, engineering, figure, scaled, styled
from ..show.tables import Variable, dataframe, dataset
from ..show.thumbnail import Curve, curves_svg

_SAMPLED = {"t": "s", "x": "m", "v": "m/s", "friction_force": "N", "at_rest": ""}
"""Fields with one entry for each sample, and their SI units."""
_MANY = 12  # More motions than this make a thumbnail illegible.


class Start(NamedTuple):
    """State at time zero: position [m], velocity [m/s], internal friction state.

    Examples:
        >>> import numpy as np
        >>> Start(x0=np.asarray(2e-3), v0=np.asarray(0.0), state=np.zeros(0)).state.shape
        (0,)
    """

    x0: Scalar
    v0: Scalar
    state: State


class Motion(eqx.Module, Reported):
    """Simulated motion at the requested times.

    Attributes:
        t: times [s].
        x: displacement from the spring's equilibrium [m].
        v: velocity [m/s].
        friction_force: friction force [N], positive if it opposes a positive velocity; at rest it balances the spring.
        at_rest: True if friction holds the mass. For a law with internal states it also requires that the remaining
            vibration of the contact is below a tenth of the requested accuracy.
        t_stop: time of the final stop [s]; inf if the mass does not stop. For a set-valued law, inf means that the mass
            never stops; for other laws, that it does not stop before the last sample. Under regularised laws and for
            driven motions it is always inf. For a law with internal states it is the end of the last half-cycle; later
            the contact only springs back and vibrates.
        turning_points: positions of the start, the reversals and the final stop in order [m]; padded with NaN.
        n_half_cycles: number of completed half-cycles before the stop, or before the last sample for laws that are not
            set-valued. Vibrations of a contact that holds the mass do not count. The number does not depend on the
            sampling of the motion.
        regularisation_bias: largest distance from the motion under the set-valued limit of a regularised law [m];
            zero for other laws, and NaN for driven motions, for which no engine integrates the set-valued limit. Its
            derivatives are zero.
        engine: name of the engine.
        result: outcome; its text states cause and remedy.
        stats: counts of the integrator.
        error: estimate of the largest numerical error of the displacement [m]; None if not requested. Its derivatives
            are zero.

    Examples:
        >>> import numpy as np
        >>> import fricjax as fj
        >>> law = fj.friction.Coulomb(mu=0.01)
        >>> oscillator = fj.Oscillator(mass=0.1, stiffness=1000.0, damping=0.05, normal_force=10.0, friction=law)
        >>> motion = fj.simulate(oscillator, 1e-3, np.asarray([0.0, 0.1, 1.0]))
        >>> motion.at_rest.tolist()
        [False, False, True]
        >>> print(motion.report().facts[1])
        ('half-cycles', '5')
    """

    t: Float[Array, " samples"]
    x: Float[Array, " samples"]
    v: Float[Array, " samples"]
    friction_force: Float[Array, " samples"]
    at_rest: Bool[Array, " samples"]
    t_stop: Float[Array, ""]
    turning_points: Float[Array, " turning_points"]
    n_half_cycles: Int[Array, ""]
    regularisation_bias: Float[Array, ""]
    engine: str = eqx.field(static=True)
    result: Any
    stats: dict[str, Any]
    error: Float[Array, ""] | None = None

    def report(self) -> Report:
        """Summarise turning points, stop and engine; a batch reports its shape."""
        if self.x.ndim > 1:
            return Report([], [("motions", str(list(self.x.shape[:-1]))), ("engine", self.engine)], heading="Motion")
        points = np.asarray(self.turning_points)
        points, stop = points[np.isfinite(points)], float(self.t_stop)
        facts = [
            ("samples", f"{self.t.size}, from {float(self.t[0]):.6g} to {float(self.t[-1]):.6g} s"),
            ("half-cycles", str(int(self.n_half_cycles))),
            (
                "turning points",
                " to ".join(engineering(point, "m", 6) for point in points[[0, -1]].tolist())
                if points.size
                else "none",
            ),
            ("stop", f"at {stop:.6g} s" if np.isfinite(stop) else "none until the last sample"),
            ("engine", self.engine),
        ]
        if self.error is not None:
            facts.append(("numerical error", engineering(float(self.error), "m")))
        data = {name: np.asarray(getattr(self, name)) for name in (*_SAMPLED, "t_stop", "n_half_cycles")}
        return Report([], facts, heading="Motion", data=data | {"turning_points": points, "engine": self.engine})

    def thumbnails(self) -> Sequence[str]:
        if isinstance(self.x, Tracer):
            return []
        many = [Curve(t, x) for t, x in zip(*self._rows("t", "x"), strict=True)]
        return [curves_svg(many[:_MANY], ("Time", "s"), ("Displacement", "m"))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot displacement and friction force against time with matplotlib.

        A batch of motions is drawn into the same axes.

        Args:
            style: as of :func:`fricjax.show.styled`.
        """
        drawing, axes = figure(2, share_x=True, heights=(3, 2))
        shown = {"Displacement": ("x", "m"), "Friction force": ("friction_force", "N")}
        for each, (label, (name, unit)) in zip(axes[:, 0], shown.items(), strict=True):
            t, values = self._rows("t", name)
            values, unit = scaled(values, unit)
            each.plot(t.T, values.T)
            each.set_ylabel(axis_label(label, unit))
        stop = np.asarray(self.t_stop)
        if stop.ndim == 0 and stop < np.max(t):
            axes[0, 0].axvline(float(stop), color="0.4", linestyle=":", label=f"stop at {float(stop):.4g} s")
            axes[0, 0].legend(loc="upper right", fontsize=8)
        axes[1, 0].set_xlabel(axis_label("Time", "s"))
        drawing.align_ylabels()
        return styled(drawing, style)

    def _rows(self, *names: str) -> list[np.ndarray]:
        """Return samples with one motion per row, shape (motions, samples)."""
        shape = self.x.shape
        rows = [np.broadcast_to(np.asarray(getattr(self, name)), shape) for name in names]
        return [each.reshape(-1, shape[-1]) for each in rows]

    def to_xarray(self) -> Any:
        """Convert to an xarray data set over `t`.

        A batch has the dimensions `motion_0`, ... and `sample`.

        Raises:
            UsageError: xarray is not installed; the message gives the command to install it.
        """
        before = [f"motion_{i}" for i in range(self.x.ndim - 1)]
        dims = [*before, "sample"] if before else ["t"]
        sampled = {name: Variable(dims, np.broadcast_to(getattr(self, name), self.x.shape), unit)
                   for name, unit in _SAMPLED.items()}  # fmt: skip
        variables = {**sampled, "t_stop": Variable(before, self.t_stop, "s", "time of the final stop")}
        variables["n_half_cycles"] = Variable(before, self.n_half_cycles)
        coordinates = {} if before else {"t": variables.pop("t")}
        return dataset(variables, coordinates, engine=self.engine)

    def to_dataframe(self) -> Any:
        """Return the samples as a data frame, one row each.

        A batch has the numbers of its motions in columns `motion_0`, ..., one for each axis.
        """
        numbers = {f"motion_{i}": index.ravel() for i, index in enumerate(np.indices(self.x.shape)[:-1])}
        samples = {name: np.broadcast_to(getattr(self, name), self.x.shape).ravel() for name in _SAMPLED}
        return dataframe(numbers | samples, _SAMPLED)
