"""What each engine gains over diffrax's own solvers on the same equation: ``python experiments/benchmarks/engines.py``.

The exact and the hybrid engine are held against slides and rests by diffrax's events and root finder, the Rosenbrock
method of the smooth engine against Kvaerno5, each with the error that it is asked for. Both are warm, one after the
other in the same process, and so is their derivative with respect to the coefficient of friction. An engine that gains
less than 1.5 times would have no reason to be there.
"""

import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)

import fricjax as fj  # noqa: E402

LAWS = {
    "Coulomb": lambda mu: fj.friction.Coulomb(mu, 0.06),
    "Stribeck": lambda mu: fj.friction.Stribeck(mu, 0.06, 5e-3),
    "Tanh": lambda mu: fj.friction.Tanh(mu, 1e-4),
    "Dahl": lambda mu: fj.friction.Dahl(mu, 1e5),
    "LuGre": lambda mu: fj.friction.LuGre(mu, 0.06, 5e-3, 1e5, 100.0),
    "MaxwellSlip": lambda mu: fj.friction.MaxwellSlip([1e5, 5e4], [mu / 2, mu / 2]),
    "RateState": lambda mu: fj.friction.RateState(mu, 0.01, 0.005, 1e-6),
}
TIMES = np.arange(5000) / 1e4
MU, ROUNDS = 0.05, 7


def motion(law: Callable, engine: str) -> Callable:
    def displacement(mu: jax.Array) -> jax.Array:
        machine = fj.Oscillator(0.41068, 2574.0, 0.17557, 9.66, law(mu))
        return fj.simulate(machine, 2e-3, TIMES, engine=engine).x

    return displacement


def timed(function: Callable) -> tuple[float, np.ndarray]:
    """Shortest time of a warm call [s], and what it gives."""
    at = jnp.asarray(MU)
    value = jax.block_until_ready(function(at))
    spans = []
    for _ in range(ROUNDS):
        begin = time.perf_counter()
        jax.block_until_ready(function(at))
        spans.append(time.perf_counter() - begin)
    return min(spans), np.asarray(value)


def main() -> None:
    print("law           engine    motion [ms]   diffrax [ms]  gain   derivative [ms]  diffrax [ms]  gain   apart [nm]")
    for name, law in LAWS.items():
        chosen = fj.simulate(fj.Oscillator(0.41068, 2574.0, 0.17557, 9.66, law(MU)), 2e-3, TIMES[:2]).engine
        rows = []
        for engine in (chosen, "diffrax"):
            path = motion(law, engine)
            derivative = jax.jit(lambda mu, path=path: jax.jvp(path, (mu,), (jnp.ones(()),))[1])
            rows.append((timed(jax.jit(path)), timed(derivative)))
        (own, slope), (reference, reference_slope) = rows
        apart = 1e9 * np.abs(own[1] - reference[1]).max()
        columns = [f"{name:13s} {chosen:7s}"]
        for ours, theirs in ((own[0], reference[0]), (slope[0], reference_slope[0])):
            columns.append(f"{1e3 * ours:15.2f} {1e3 * theirs:13.2f} {theirs / ours:5.1f}")
        print(*columns, f"{apart:11.3f}", flush=True)


if __name__ == "__main__":
    main()
