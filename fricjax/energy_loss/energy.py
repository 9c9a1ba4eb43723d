"""Energy of a measured decay, and its loss rate (paper, Fig. 9)."""

import dataclasses
from typing import Any

import numpy as np

from ..data.gather import record_of
from ..oscillator import ready
from ..rig import Rig
from ..show import Style, axis_label, figure, scaled, styled
from .decay import decay, frictionless, with_losses
from .force_samples import force_samples


@dataclasses.dataclass(frozen=True, eq=False)
class EnergyLoss:
    """Energy of a measured decay after the first reversal; shapes (n,).

    Attributes:
        t: times [s].
        energy: kinetic and potential energy [J], relative to the equilibrium at `offset`.
        rate: its rate of change v (m a + R(x)) [W], negative for a loss.
        rate_std: standard deviation of the rate from the noise of the record [W].
        viscous_power, drag_power: loss to damping, c v^2, and to drag, drag |v|^3 [W].
        friction_power: the remaining loss [W].
        offset: equilibrium position in the record [m].

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> loss = fj.energy_loss.energy_of(files.run, fj.Rig.from_toml(files.rig))
        >>> loss.energy.shape == loss.t.shape == loss.friction_power.shape
        True
    """

    t: np.ndarray
    energy: np.ndarray
    rate: np.ndarray
    rate_std: np.ndarray
    viscous_power: np.ndarray
    drag_power: np.ndarray
    friction_power: np.ndarray
    offset: float

    def plot(self, *, style: Style = "screen") -> Any:
        """Plot energy and loss rates against time.

        Args:
            style: see :func:`fricjax.show.styled`.

        Returns:
            A matplotlib figure.
        """
        drawing, axes = figure(2, 1, share_x=True)
        top, bottom = axes[:, 0]
        values, unit = scaled(self.energy, "J")
        top.plot(self.t, values)
        top.set_ylabel(axis_label("Energy", unit))
        shown = {"all": -self.rate, "friction": self.friction_power, "viscous": self.viscous_power}
        powers, unit = scaled(np.array(list(shown.values())), "W")
        for name, power in zip(shown, powers, strict=True):
            bottom.plot(self.t, power, label=name)
        bottom.set_ylabel(axis_label("Loss rate", unit))
        bottom.set_xlabel(axis_label("Time", "s"))
        bottom.legend(loc="upper right", fontsize=8)
        return styled(drawing, style)


def energy_of(record: Any, rig: Rig, no_contact: Any = None, *, offset: float | None = None) -> EnergyLoss:
    """Compute the energy of a record and its loss rate.

    Args:
        record: a free decay, as for :func:`fricjax.fit`.
        rig: mass, restoring force, damping and drag.
        no_contact: a run without contact; its damping and drag replace those of the rig.
        offset: equilibrium position in the record [m]; None: fitted as in `friction_force_map`.

    Raises:
        RuntimeError: JAX computes in single precision.
        UsageError: arguments that do not fit, or a rig without damping.
        DataError: a record with too few half-cycles, or sampled unevenly.

    Examples:
        >>> import fricjax as fj
        >>> files = fj.data.example_paths()
        >>> loss = fj.energy_loss.energy_of(files.run, fj.Rig.from_toml(files.rig))
        >>> bool(loss.energy[0] > 10 * loss.energy[-1])
        True
    """
    ready()
    oscillator = frictionless(with_losses(rig, no_contact))
    samples = force_samples(decay(record_of(record), 2 if offset is None else 1), oscillator, offset)
    mass, v, speed = float(oscillator.mass), samples.v, np.abs(samples.v)
    net = mass * samples.a + np.asarray(oscillator.restoring_force(samples.x))  # pyright: ignore[reportArgumentType]
    potential = oscillator.restoring.potential(samples.x, oscillator.stiffness)  # pyright: ignore[reportArgumentType]
    viscous, drag = float(oscillator.damping) * v**2, float(oscillator.drag) * speed**3
    return EnergyLoss(
        t=np.concatenate([each.half_cycle.t for each in samples.smoothed]),
        energy=mass * v**2 / 2 + np.asarray(potential),
        rate=v * net,
        rate_std=samples.std((v * samples.weights[0], net, mass * v)),
        viscous_power=viscous,
        drag_power=drag,
        friction_power=-v * net - viscous - drag,
        offset=samples.offset,
    )
