"""Print the accuracy of the energy routes: ``python -m tests.energy_loss.figures``."""

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402

from fricjax.energy_loss.force_fit import fit_force_map  # noqa: E402
from fricjax.energy_loss.force_map import ForceMap, friction_force_map  # noqa: E402
from fricjax.energy_loss.half_cycles import half_cycle_friction  # noqa: E402
from fricjax.friction import Coulomb, Stribeck  # noqa: E402
from tests.energy_loss.runs import LOAD, RIG, campaign  # noqa: E402


def deviations(found: ForceMap, static: float = 0.05) -> np.ndarray:
    """Force of the map minus the true force, in standard deviations."""
    v = found.velocity
    return (found.force - np.sign(v) * LOAD * (0.05 + (static - 0.05) * np.exp(-((v / 5e-3) ** 2)))) / found.std


def stribeck() -> None:
    runs = campaign(Stribeck(0.05, 0.065, 5e-3), 0.5e-3, 2e-3, 7)
    for bins in (12, 24, np.geomspace(1e-3, 0.12, 30), np.geomspace(1e-3, 0.12, 60)):
        found = friction_force_map(runs, RIG, bins=bins)
        seen = np.abs(found.velocity) > 1e-3
        z, near = deviations(found, 0.065)[seen], np.abs(np.abs(found.velocity) - 5e-3) < 1e-3
        worst = np.max(found.std[near] / np.abs(found.force[near]))
        share = np.mean(np.abs(z) < 2)
        print(
            f"Stribeck, {z.size} bins: {100 * share:.1f} % within 2 std, worst std at 5 mm/s {100 * worst:.3f} % of F"
        )
    print(fit_force_map(friction_force_map(runs, RIG), Stribeck(0.04, 0.08, 2e-3)).summary())


def coulomb() -> None:
    for release in (0.0, 1e-3, 3e-3):
        runs = campaign(Coulomb(0.05), 0.25e-3, 2e-3, 36, rate=10e3, release_time_constant=release)
        balance, found = half_cycle_friction(runs, RIG), friction_force_map(runs, RIG)
        share = np.mean(np.abs(deviations(found)) < 2)
        print(
            f"Coulomb, release {1e3 * release:g} ms: half-cycles {balance.mu.value / 0.05 - 1:.1e}, "
            f"mean of the map {found.mu.value / 0.05 - 1:.1e} (std {found.mu.std / 0.05:.1e}), "
            f"{100 * share:.1f} % of bins within 2 std, {len(balance.offsets)} of 36 runs used"
        )


if __name__ == "__main__":
    stribeck()
    coulomb()
