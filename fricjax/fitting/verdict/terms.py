"""Terms that a model may miss, each with the request that fits it."""

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import equinox as eqx
import numpy as np

from ...friction import Coulomb, Stribeck
from ...oscillator import Oscillator
from ...oscillator.oscillator import leaves_of
from ...oscillator.restoring import Cubic, Linear, Pendulum
from ..names import sole_coulomb
from ..parameters import Request
from ..window import Window

# Start values of falling friction: static over dynamic coefficient, the same for weak falling, and Stribeck velocity
# over the largest speed.
_STATIC, _WEAK, _FALL = 1.2, 1.02, 0.1


class Term(NamedTuple):
    """A term and the request that fits it.

    Attributes:
        name: its name for fitted values, empty if no machine has such values.
        how: arguments that fit it.
        request: request of the fit.
        neutral: values of its coefficients with which the model is nearly the one without it.
    """

    name: Callable[[Mapping[str, float]], str]
    how: str
    request: Request
    neutral: Mapping[str, float] = {}


def terms(request: Request, window: Window, values: Mapping[str, float]) -> Iterator[Term]:
    """Yield the terms that a request may miss.

    Args:
        request: the request.
        window: the fitted part of its first record.
        values: fitted values by name.
    """
    machine, free = request.oscillator, request.free
    present = {leaf.dotted.rsplit(".", 1)[-1] for leaf in leaves_of(machine)}
    fitted = {name.rsplit(".", 1)[-1] for name in free}
    if "drag" not in fitted and "quadratic_drag" not in present:
        more = changed(request, machine, (*free, "drag"))
        yield Term(
            lambda at: "quadratic drag" if at["drag"] > 0 else "", f"with free={list(more.free)}", more, {"drag": 0.0}
        )
    if not {"damping", "sigma2", "eta_h"} & fitted:
        more = changed(request, machine, (*free, "damping"))
        yield Term(
            lambda at: "viscous damping" if at["damping"] > 0 else "",
            f"with free={list(more.free)}",
            more,
            {"damping": float(machine.damping)},
        )
    for name in free:
        if name in request.bounds and values.get(name) in request.bounds[name]:
            yield _unbounded(request, name)
    if isinstance(machine.restoring, Linear):
        yield from _springs(request, window)
    alone = sole_coulomb(machine.friction) is machine.friction
    if alone and "mu" in free and values.get("mu", 0.0) > 0:
        yield _falling(request, window, values["mu"])


def _unbounded(request: Request, name: str) -> Term:
    """Return the request without a bound that the user set."""
    bounds = {key: each for key, each in request.bounds.items() if key != name}
    words = lambda at: f"{name} beyond its bound" if min(at.get("mu", 0.0), at.get("damping", 0.0)) >= 0 else ""
    return Term(words, f"with another bound of {name}", dataclasses.replace(request, bounds=bounds))


def _springs(request: Request, window: Window) -> Iterator[Term]:
    machine, free = request.oscillator, request.free
    if window.quantity == "rad":
        pendulum = changed(request, eqx.tree_at(lambda o: o.restoring, machine, Pendulum()), free)
        yield Term(lambda at: "the restoring force of a pendulum", "with restoring=Pendulum()", pendulum)
    cubic = changed(request, eqx.tree_at(lambda o: o.restoring, machine, Cubic(0.0)), (*free, "k3"))

    def name(at: Mapping[str, float]) -> str:
        return f"a spring that {'softens' if at['k3'] < 0 else 'stiffens'} with deflection"

    yield Term(name, f"with restoring=Cubic(0.0) and free={list(cubic.free)}", cubic, {"k3": 0.0})


def _falling(request: Request, window: Window, mu: float) -> Term:
    """Return friction that falls with velocity instead of Coulomb friction."""
    segmentation = window.segmentation
    speed = segmentation.amplitude * np.pi / segmentation.half_period
    law = Stribeck(mu, mu_s=_STATIC * mu, v_stribeck=_FALL * speed)
    free = (*(name for name in request.free if name != "mu_s"), "mu_s", "v_stribeck")
    machine = eqx.tree_at(lambda o: o.friction, request.oscillator, law)
    how = f"with friction=Stribeck(...) and free={list(free)}"
    name = lambda at: "friction that falls with velocity" if at["mu_s"] > at["mu"] > 0 else ""
    neutral = {"mu_s": _WEAK * mu, "v_stribeck": _FALL * speed}
    return Term(name, how, changed(request, machine, free), neutral)


def without_friction(request: Request) -> Request | None:
    """Return the request without dry friction, None if it has none to leave out."""
    free = tuple(name for name in request.free if name not in ("mu", "mu_s"))
    alone = sole_coulomb(request.oscillator.friction) is request.oscillator.friction
    if not alone or "mu" not in request.free or not free:
        return None
    return changed(request, eqx.tree_at(lambda o: o.friction, request.oscillator, Coulomb(0.0)), free)


def changed(request: Request, machine: Oscillator, free: tuple[str, ...]) -> Request:
    """Return the request with another machine and other free coefficients."""
    lost = set(request.free) - set(free)
    tables = {
        name: {key: value for key, value in getattr(request, name).items() if key not in lost}
        for name in ("bounds", "priors", "guess")
    }
    return dataclasses.replace(request, oscillator=machine, free=free, **tables)
