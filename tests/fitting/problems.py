"""Classic problems of least squares."""

import jax.numpy as jnp
import numpy as np
import optimistix as optx

from fricjax.estimation.levenberg_marquardt import LevenbergMarquardt

T = np.linspace(0.0, 2.0, 40)
NOISE = np.random.default_rng(3).standard_normal((3, T.size))
LINE = 2.0 - 3.0 * T + 0.1 * NOISE[0]
CLEAN = 5.0 * np.exp(-1.7 * T) + 0.5
DECAY = CLEAN + 0.05 * NOISE[1]
# Meyer's resistances of a thermistor at 50, 55, ... 125 degrees (Meyer, 1970; NIST calls them MGH10).
THERMISTOR = np.array(
    [34780, 28610, 23650, 19630, 16370, 13720, 11540, 9744, 8261, 7030, 6005, 5147, 4427, 3820, 3307, 2872.0]
)
TEMPERATURE = 45 + 5 * np.arange(1, 17.0)


def line(p, args=None):
    return p[0] + p[1] * jnp.asarray(T) - LINE


def decay(p, args=None):
    return p[0] * jnp.exp(-p[1] * jnp.asarray(T)) + p[2] - DECAY


def clean_decay(p, args=None):
    return p[0] * jnp.exp(-p[1] * jnp.asarray(T)) + p[2] - CLEAN


def rosenbrock(p, args=None):
    return jnp.stack([10 * (p[1] - p[0] ** 2), 1 - p[0]])


def noisy_rosenbrock(p, args=None):
    """Rosenbrock residuals with a constant, so that the minimum is not zero."""
    return jnp.concatenate([rosenbrock(p), jnp.asarray([0.1, -0.1])])


def powell(p, args=None):
    """Powell's singular function: two directions vanish at the optimum."""
    return jnp.stack([p[0] + 10 * p[1], 5**0.5 * (p[2] - p[3]), (p[1] - 2 * p[2]) ** 2, 10**0.5 * (p[0] - p[3]) ** 2])


def beale(p, args=None):
    return jnp.stack([c - p[0] * (1 - p[1] ** k) for c, k in ((1.5, 1), (2.25, 2), (2.625, 3))])


def brown(p, args=None):
    """Brown's badly scaled function, with the optimum at (1e6, 2e-6)."""
    return jnp.stack([p[0] - 1e6, p[1] - 2e-6, p[0] * p[1] - 2])


def meyer(p, args=None):
    return p[0] * jnp.exp(p[1] / (jnp.asarray(TEMPERATURE) + p[2])) - THERMISTOR


NOISY = {
    "line": (line, (0.0, 0.0)),
    "decay": (decay, (1.0, 1.0, 0.0)),
    "decay from afar": (decay, (40.0, 8.0, -10.0)),
    "rosenbrock": (noisy_rosenbrock, (-1.2, 1.0)),
    "meyer": (meyer, (0.02, 4000.0, 250.0)),
}
EXACT = {
    "decay": (clean_decay, (1.0, 1.0, 0.0), (5.0, 1.7, 0.5)),
    "rosenbrock": (rosenbrock, (-1.2, 1.0), (1.0, 1.0)),
    "beale": (beale, (1.0, 1.0), (3.0, 0.5)),
    "brown": (brown, (1.0, 1.0), (1e6, 2e-6)),
}


def options_for(fn, start, *, args=None, lower: object = -np.inf, upper: object = np.inf, floor=0.0, **more):
    return {
        "lower": jnp.broadcast_to(jnp.asarray(lower, float), start.shape),
        "upper": jnp.broadcast_to(jnp.asarray(upper, float), start.shape),
        "dof": jnp.asarray(float(max(fn(start, args).size - start.size, 1))),
        "floor": jnp.asarray(floor),
        **more,
    }


def solve(fn, start, *, args=None, solver=None, max_steps=200, **options):
    """Solve a problem.

    Calls with the same `fn` and shapes share a compiled program.
    """
    start = jnp.asarray(start, float)
    return optx.least_squares(
        fn,
        solver or LevenbergMarquardt(max_steps=max_steps),
        start,
        args=args,
        options=options_for(fn, start, args=args, **options),
        max_steps=max_steps + 1,
        throw=False,
    )


def status(solution):
    return int(solution.stats["status"])


def steps(solution):
    return int(solution.stats["num_steps"])
