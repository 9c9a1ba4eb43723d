"""Terms that a model may miss."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import equinox as eqx
import jax
import numpy as np

from ...friction import Stribeck
from ...oscillator import Oscillator
from ...oscillator.oscillator import leaves_of
from ...oscillator.restoring import AbstractRestoring, Cubic, Linear, Pendulum
from ..names import sole_coulomb
from ..parameters import Request
from ..window import Window

# Stribeck velocity over the largest speed, and a second one. A fit starts from constant friction, which does not stop
# the mass too early.
_FALL, _FALL_FIRST = 0.1, 0.02


class Term(NamedTuple):
    """A term that a model may miss.

    Attributes:
        name: its name for fitted values, empty if no machine has such values.
        change: function from a request to the one that fits it.
        neutral: its coefficients, with values for which the model is the one without it.
        other: further values from which a fit starts; empty for a term that only adds a force.
        how: arguments that fit it, unless they follow from the changed request.
    """

    name: Callable[[Mapping[str, float]], str]
    change: Callable[[Request], Request]
    neutral: Mapping[str, float] = {}
    other: Mapping[str, float] = {}
    how: str = ""


def terms(request: Request, window: Window, values: Mapping[str, float]) -> Iterator[Term]:
    """Yield the terms that a request may miss.

    Args:
        request: the request.
        window: the fitted part of its first record.
        values: fitted values by name.
    """
    machine = request.oscillator
    present = {leaf.dotted.rsplit(".", 1)[-1] for leaf in leaves_of(machine)}
    fitted = {name.rsplit(".", 1)[-1] for name in request.free}
    if "drag" not in fitted and "quadratic_drag" not in present:
        name = lambda at: "quadratic drag" if at["drag"] > 0 else ""
        yield Term(name, lambda of: changed(of, of.oscillator, "drag"), {"drag": float(machine.drag)})
    for leaf in leaves_of(machine):
        if leaf.kind == "quadratic_drag" and leaf.kind not in fitted:
            yield _freed_drag(leaf.name, float(jax.tree.leaves(machine)[leaf.index]))
    if not {"damping", "sigma2", "eta_h"} & fitted:
        name = lambda at: "viscous damping" if at["damping"] > 0 else ""
        yield Term(name, lambda of: changed(of, of.oscillator, "damping"), {"damping": float(machine.damping)})
    for name in request.free:
        if name in request.bounds and values.get(name) in request.bounds[name]:
            yield _unbounded(name)
    if isinstance(machine.restoring, Linear):
        yield from _springs(window)
    alone = sole_coulomb(machine.friction) is machine.friction
    if alone and "mu" in request.free and values.get("mu", 0.0) > 0:
        yield _falling(window, values["mu"])


def _freed_drag(name: str, value: float) -> Term:
    """Return the drag of a law that is not free."""
    words = lambda at: "quadratic drag" if at[name] > 0 else ""
    return Term(words, lambda of: changed(of, of.oscillator, name), {name: value})


def _unbounded(name: str) -> Term:
    """Return the request without a bound that the user set."""

    def change(of: Request) -> Request:
        return dataclasses.replace(of, bounds={key: each for key, each in of.bounds.items() if key != name})

    words = lambda at: f"{name} beyond its bound" if min(at.get("mu", 0.0), at.get("damping", 0.0)) >= 0 else ""
    return Term(words, change, how=f"with another bound of {name}")


def _springs(window: Window) -> Iterator[Term]:
    """Yield other springs than the linear one."""

    def pulled(restoring: AbstractRestoring, *more: str) -> Callable[[Request], Request]:
        return lambda of: changed(of, eqx.tree_at(lambda o: o.restoring, of.oscillator, restoring), *more)

    if window.quantity == "rad":
        name = lambda _: "the restoring force of a pendulum"
        yield Term(name, pulled(Pendulum()))
    name = lambda at: f"a spring that {'softens' if at['k3'] < 0 else 'stiffens'} with deflection"
    yield Term(name, pulled(Cubic(0.0), "k3"), {"k3": 0.0})


def _falling(window: Window, mu: float) -> Term:
    """Return friction that falls with velocity instead of Coulomb friction."""
    segmentation = window.segmentation
    speed = segmentation.amplitude * np.pi / segmentation.half_period
    law = Stribeck(mu, mu_s=mu, v_stribeck=_FALL * speed)

    def change(of: Request) -> Request:
        machine = eqx.tree_at(lambda o: o.friction, of.oscillator, law)
        of = dataclasses.replace(of, free=tuple(name for name in of.free if name != "mu_s"))
        return changed(of, machine, "mu_s", "v_stribeck")

    name = lambda at: "friction that falls with velocity" if at["mu_s"] > at["mu"] > 0 else ""
    return Term(name, change, {"mu_s": mu, "v_stribeck": _FALL * speed}, {"v_stribeck": _FALL_FIRST * speed})


def changed(request: Request, machine: Oscillator, *more: str) -> Request:
    """Return the request with another machine and more free coefficients."""
    return dataclasses.replace(request, oscillator=machine, free=(*request.free, *more))
