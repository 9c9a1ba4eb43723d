"""Fig. 6: final against initial displacement, as a synthetic experiment.

The figure shows three trials with sliding UHMWPE. The paper does not print the coefficient of friction. A triangle wave
is visible between 0.25 and 1 mm only if its period, 15 mm times mu, is at most about that range. Hence mu = 0.05.
"""

from typing import Any

import closed_form
import jax
import numpy as np
from common import Number, Study, prototype

import fricjax as fj

LOAD, MU, TRIALS, SEED = 9.66, 0.05, 3, 6
NOMINAL = np.linspace(0.25e-3, 1.0e-3, 31)
# Scatter between releases: of mu, typical of polymers on metal, and of the start [m], from the magnet.
MU_SCATTER, X0_SCATTER = 0.02, 3e-6


def study() -> Study:
    """Simulate three trials and their spread about the map."""
    normal = np.random.default_rng(SEED).standard_normal((2, TRIALS, NOMINAL.size))
    mu, x0 = MU * (1 + MU_SCATTER * normal[0]), NOMINAL + X0_SCATTER * normal[1]
    final = np.asarray(released(mu.ravel(), x0.ravel())).reshape(mu.shape)
    columns = {
        "Trial": np.repeat(np.arange(1, TRIALS + 1), NOMINAL.size),
        "Nominal initial displacement [m]": np.tile(NOMINAL, TRIALS),
        "Effective initial displacement [m]": x0.ravel(),
        "Coefficient of friction": mu.ravel(),
        "Final displacement [m]": final.ravel(),
    }
    note = (
        f"Prototype with N = {LOAD} N; mu = {MU} is our choice, because the paper prints none. Each release has "
        f"another mu ({100 * MU_SCATTER:g} % standard deviation) and effective start ({1e6 * X0_SCATTER:g} um). After "
        "n half-cycles the final displacement scatters by 2 n xd times the relative scatter of mu. The spread of "
        "the repeats in Fig. 6 thus comes from the repeatability of mu. The spread is a statistic of 45 releases, good "
        "to about 10 %. Its closed form is of first order and neglects the folds at the peaks. The mu of each trial is "
        "fitted to its 31 pairs and has a standard error of about 0.4 %."
    )
    title = "Figure 6: synthetic experiment, sliding UHMWPE on anodized aluminium"
    return Study(title, note, _numbers(final), columns, _picture(final))


@jax.jit
@jax.vmap
def released(mu: Any, x0: Any) -> jax.Array:
    """Compute the final displacement [m] of one release."""
    return fj.final_displacement(prototype(LOAD, mu), x0)


def _numbers(final: np.ndarray) -> tuple[Number, ...]:
    exact = closed_form.of(prototype(LOAD, MU))
    ends = [exact.rest(x0) for x0 in NOMINAL]
    twice = np.array([end.half_cycles == 2 for end in ends])
    deviation = (final - np.array([end.x for end in ends]))[:, twice]
    expected = np.hypot(exact.rho * X0_SCATTER, 2 * 2 * exact.dead_band * MU_SCATTER)
    last = float(released(np.array([MU]), NOMINAL[-1:])[0])
    fitted = [_fitted(values) for values in final]
    return (
        *(Number(f"mu of trial {trial} by route 2", "", mu, MU) for trial, mu in enumerate(fitted, 1)),
        Number("final displacement of x0 = 1 mm without scatter", "m", last, ends[-1].x),
        Number("spread of xf after two half-cycles", "m", float(np.sqrt(np.mean(deviation**2))), float(expected)),
    )


def _fitted(final: np.ndarray) -> float:
    """Fit mu of one trial to its nominal starts.

    The fit includes the scatter between releases.
    """
    machine = prototype(LOAD, 0.8 * MU)
    found = fj.fit_final_displacements(NOMINAL, final, machine, nuisance=(), sigma=X0_SCATTER, mu_scatter=MU_SCATTER)
    return found.values["mu"]


def _picture(final: np.ndarray) -> Any:
    picture, axes = fj.show.figure()
    only = axes[0, 0]
    fine = np.linspace(NOMINAL[0], NOMINAL[-1], 1001)
    only.plot(1e3 * fine, 1e3 * released(np.full(fine.size, MU), fine), color="0.6", label=f"map, mu = {MU}")
    for trial, (marker, values) in enumerate(zip("osv", final, strict=True), 1):
        only.plot(1e3 * NOMINAL, 1e3 * values, marker, markersize=3.5, fillstyle="none", label=f"trial {trial}")
    only.set_xlabel("Initial displacement x0 [mm]")
    only.set_ylabel("Final displacement xf [mm]")
    only.set_ylim(-0.25, 0.33)
    only.legend(loc="upper center", ncols=4, fontsize=8)
    return picture
