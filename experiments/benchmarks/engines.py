"""Compare the engines with diffrax's own solvers on the same equations.

Usage: `python experiments/benchmarks/engines.py`.

The peers of the exact and the hybrid engine are diffrax's events and root finder for slides and rests. The peer of the
smooth engine, a Rosenbrock method, is Kvaerno5. Each solver runs at its own error tolerance. Both run warm, one after
the other in the same process, and so do their derivatives with respect to the coefficient of friction. An engine must
be at least 1.5 times faster to justify its code.

Engines serve fits, so the script also fits two laws. fricjax uses the hybrid engine with all its checks, standard
errors and report. The peer is Levenberg and Marquardt's method on the same residuals of the same record, with motions
and derivatives from diffrax. Both free the same five parameters. The peer starts within a percent of the truth, fricjax
from its automatic guess.
"""

import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx

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
FREE = ("mu", "damping", "stiffness")
TRUTH = np.array([MU, 0.17557, 2574.0, 2e-3])
NOISE = 1e-9


def motion(law: Callable, engine: str) -> Callable:
    def displacement(mu: jax.Array) -> jax.Array:
        machine = fj.Oscillator(0.41068, 2574.0, 0.17557, 9.66, law(mu))
        return fj.simulate(machine, 2e-3, TIMES, engine=engine).x

    return displacement


def timed(function: Callable) -> tuple[float, np.ndarray]:
    """Return the shortest time of a warm call [s] and its result."""
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


def fit_by_diffrax(law: Callable, x: np.ndarray) -> Callable[[], jax.Array]:
    """Build a fit by diffrax and optimistix alone.

    The free parameters are mu, damping, stiffness, start and offset.
    """

    def residual(q: jax.Array, data: jax.Array) -> jax.Array:
        mu, damping, stiffness, x0 = TRUTH * q[:4]
        machine = fj.Oscillator(0.41068, stiffness, damping, 9.66, law(mu))
        return (fj.simulate(machine, x0, TIMES, engine="diffrax").x + NOISE * q[4] - data) / NOISE

    @jax.jit
    def solve(q: jax.Array, data: jax.Array) -> jax.Array:
        solver = optx.LevenbergMarquardt(rtol=1e-9, atol=1e-9)
        return optx.least_squares(residual, solver, q, data, options={"jac": "fwd"}, max_steps=60, throw=False).value

    return lambda: jax.block_until_ready(solve(jnp.array([1.01, 0.99, 1.0001, 1.001, 0.0]), jnp.asarray(x)))


def fits() -> None:
    print("\nfit of five parameters   hybrid [ms]   diffrax [ms]  gain   apart [standard errors]")
    for name in ("Stribeck", "Tanh"):
        law = LAWS[name]
        machine = fj.Oscillator(0.41068, 2574.0, 0.17557, 9.66, law(MU))
        run = fj.synthetic_run(machine, 2e-3, rate=1e4, duration=0.5, noise=NOISE, seed=1)
        own = lambda run=run, machine=machine: fj.fit(run, machine, FREE, engine="hybrid", start="release", throw=False)
        reference = fit_by_diffrax(law, run.x)
        fit, solution = own(), reference()
        spans = {}
        for engine, once in (("hybrid", own), ("diffrax", reference)):
            spans[engine] = []
            for _ in range(ROUNDS):
                begin = time.perf_counter()
                once()
                spans[engine].append(time.perf_counter() - begin)
        ours, theirs = (1e3 * min(each) for each in spans.values())
        values = dict(zip(FREE, TRUTH * np.asarray(solution)[:4], strict=False))
        apart = max(abs(fit.values[key] - value) / fit.std_errors[key] for key, value in values.items())
        print(f"{name:24s} {ours:11.1f} {theirs:14.1f} {theirs / ours:5.1f} {apart:14.3f}", flush=True)


if __name__ == "__main__":
    main()
    fits()
