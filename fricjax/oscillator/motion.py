"""What a simulation returns: the motion, its turning points, and how it was computed."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import equinox as eqx
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Bool, Float, Int

from ..friction.base import Scalar, State
from ..show import Report, Reported, Style, Table, axis_label, engineering, figure, scaled, styled
from ..show.tables import Variable, dataset
from ..show.thumbnail import Curve, curves_svg

_SAMPLED = ("t", "x", "v", "friction_force", "at_rest")
"""Fields with one entry for each sample."""
_MANY = 12  # motions beyond which a thumbnail is a blot


class Start(NamedTuple):
    """State of the mass at time zero: position [m], velocity [m/s], internal state of the friction law.

    Examples:
        >>> import numpy as np
        >>> Start(x0=np.asarray(2e-3), v0=np.asarray(0.0), state=np.zeros(0)).state.shape
        (0,)
    """

    x0: Scalar
    v0: Scalar
    state: State


class Motion(eqx.Module, Reported):
    """A simulated motion, sampled at the times asked for.

    Attributes:
        t: times [s].
        x: displacement from the spring's equilibrium [m].
        v: velocity [m/s].
        friction_force: friction force [N], positive where it opposes a positive velocity; at rest what balances the
            spring.
        at_rest: True where a set-valued law holds the mass, or the contact of a law with internal states so that what
            is left of its ringing is below a tenth of the accuracy asked for.
        t_stop: time of the final stop [s]; under a law with internal states the end of the last half-cycle, behind
            which the contact only springs back and rings; inf where the mass does not stop until the last sample (until
            ever, under a set-valued law), as under regularised laws and where it is driven.
        turning_points: positions of the start and of the reversals in order [m], the last one the final stop; NaN
            beyond.
        n_half_cycles: number of completed half-cycles until the stop, or until the last sample where a law is not
            set-valued. The ringing of a contact that holds the mass is none. It does not depend on how densely a
            motion is sampled.
        regularisation_bias: largest distance to the motion under the set-valued law that a regularised one stands
            for [m]; zero for every other law, and NaN for a driven motion, whose set-valued twin no engine integrates.
        engine: name of the engine.
        result: outcome; its text tells cause and remedy.
        stats: counts of the integrator.

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

    def report(self) -> Report:
        """How far the mass went, when it stopped, and how that was computed; of several motions only how many."""
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
        data = {name: np.asarray(getattr(self, name)) for name in (*_SAMPLED, "t_stop", "n_half_cycles")}
        return Report([], facts, heading="Motion", data=data | {"turning_points": points, "engine": self.engine})

    def thumbnails(self) -> Sequence[str]:
        if isinstance(self.x, Tracer):
            return []
        many = [Curve(t, x) for t, x in zip(*self._rows("t", "x"), strict=True)]
        return [curves_svg(many[:_MANY], ("Time", "s"), ("Displacement", "m"))]

    def plot(self, *, style: Style = "screen") -> Any:
        """Displacement and friction force against time, as a matplotlib figure; of several motions each.

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
        """Samples of each motion in a row of its own, shape (motions, samples)."""
        shape = self.x.shape
        rows = [np.broadcast_to(np.asarray(getattr(self, name)), shape) for name in names]
        return [each.reshape(-1, shape[-1]) for each in rows]

    def to_xarray(self) -> Any:
        """A data set of xarray over `t`; of several motions over the axes `motion_0`, ... and `sample`.

        Raises:
            UsageError: xarray is not installed; the sentence says how to.
        """
        before = [f"motion_{i}" for i in range(self.x.ndim - 1)]
        dims = [*before, "sample"] if before else ["t"]
        units = {"t": "s", "x": "m", "v": "m/s", "friction_force": "N", "at_rest": ""}
        sampled = {name: Variable(dims, np.broadcast_to(getattr(self, name), self.x.shape), unit)
                   for name, unit in units.items()}  # fmt: skip
        variables = {**sampled, "t_stop": Variable(before, self.t_stop, "s", "time of the final stop")}
        variables["n_half_cycles"] = Variable(before, self.n_half_cycles)
        coordinates = {} if before else {"t": variables.pop("t")}
        return dataset(variables, coordinates, engine=self.engine)

    def to_dataframe(self) -> Any:
        """The samples, one row each."""
        columns = [np.asarray(getattr(self, name)).tolist() for name in _SAMPLED]
        return Table(_SAMPLED, list(zip(*columns, strict=True))).to_dataframe()
