"""Compare the routes on simulated campaigns with known coefficients.

The first table gives the relative error of the dynamic coefficient by each route in five scenarios: detection noise of
1 and 10 nm, the interferometer's own errors, and a magnet that releases within 1 and 3 ms. Each campaign has thirty-six
runs of the prototype rig from 0.25 to 2 mm, mu = 0.05, damping ratio 0.27 %, 10 kHz.

The second part brackets the static coefficient in 200 campaigns. It also counts how often the 95 % interval from the
probability of a stop contains the truth, in 2,000 campaigns with scatter.

    python experiments/routes/run.py [--only scenarios|bracket|probit] [--runs 36] [--campaigns 2000] [--json FILE]
"""

import argparse
import json
from pathlib import Path
from typing import Any

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from static import bracketed, coverage  # noqa: E402

import fricjax as fj  # noqa: E402
from fricjax import (  # noqa: E402
    compare_routes,
    fit_final_displacements,
    fit_triangle_map,
    friction_force_map,
    pairs_of,
)
from fricjax.errors import DataError  # noqa: E402

MASS, STIFFNESS, DAMPING_RATIO, LOAD, MU = 0.41068, 2574.0, 0.0027, 9.66, 0.05
DAMPING = 2 * DAMPING_RATIO * np.sqrt(MASS * STIFFNESS)
RIG = fj.Rig(mass=MASS, stiffness=STIFFNESS, damping=DAMPING, normal_force=LOAD)
COUNT = 0.31e-9
SCENARIOS: dict[str, dict[str, Any]] = {
    "1 nm": {"noise": 1e-9},
    "10 nm": {"noise": 10e-9},
    "1 nm, periodic error, drift, jitter": {
        "noise": 1e-9,
        "periodic_nonlinearity": 2e-9,
        "drift": 5e-9,
        "sampling_jitter": 20e-9,
    },
    "release of 1 ms": {"noise": 1e-9, "release_time_constant": 1e-3},
    "release of 3 ms": {"noise": 1e-9, "release_time_constant": 3e-3},
}
# Limits of the relative error by route, for fast and for slow releases. None: no limit.
LIMITS = {
    "1 traces": (1e-5, 1e-5),
    "2 final displacements": (1e-5, 1e-5),
    "3 triangle map": (3e-3, None),
    "4 energy, half-cycles": (1e-5, 1e-5),
    "4 energy, samples": (1e-4, None),
}


def machine(mu: float) -> fj.Oscillator:
    return RIG.oscillator(fj.friction.Coulomb(mu))


def campaign(name: str, runs: int) -> list[fj.Record]:
    how = {"rate": 10e3, "duration": 0.45, "quantisation": COUNT, "offset": 3e-6, "hold": 0.02} | SCENARIOS[name]
    starts = np.linspace(0.25e-3, 2e-3, runs)
    return [fj.synthetic_run(machine(MU), x0 - 3e-6, seed=i, **how) for i, x0 in enumerate(starts)]


def errors(name: str, runs: int) -> dict[str, float]:
    """Compute the relative error of mu by each route."""
    records = campaign(name, runs)
    found = {route.name: route.mu.value / MU - 1 for route in compare_routes(records, RIG).routes}
    held = pairs_of(records, start="release")
    try:
        fit = fit_final_displacements(held.x0, held.xf, machine(0.03), half_cycles=held.half_cycles)
        found["2, held displacement"] = fit.values["mu"] / MU - 1
        shape = fit_triangle_map(held.x0, held.xf, RIG)
        found["3, held displacement"] = shape.values["mu"] / MU - 1
        found["3, without damping"] = shape.extras["mu_from_period_without_damping"].value / MU - 1
    except DataError as error:
        print(f"{name}: {error}")
    return found


def scenarios(runs: int) -> dict[str, dict[str, float]]:
    """Print all scenarios as a table."""
    table = {name: errors(name, runs) for name in SCENARIOS}
    routes = list(dict.fromkeys(route for row in table.values() for route in row))
    rows = [
        [route, *(table[name].get(route, float("nan")) for name in SCENARIOS), _verdict(route, table)]
        for route in routes
    ]
    shown = [[row[0], *(f"{value:+.1e}" for value in row[1:-1]), row[-1]] for row in rows]
    print(fj.show.Table(["Relative error of mu", *SCENARIOS, "Limit"], shown).text())
    return table


def _verdict(route: str, table: dict[str, dict[str, float]]) -> str:
    """Format the limits of a route, and if they hold."""
    if route not in LIMITS:
        return ""
    quiet, slow = LIMITS[route]
    held = all(
        abs(row.get(route, np.inf)) <= limit
        for name, row in table.items()
        if (limit := slow if "release" in name else quiet) is not None
    )
    return f"{quiet:g}{'' if slow else ' (releases at once)'}: {'holds' if held else 'MISSED'}"


def stribeck() -> dict[str, float]:
    """Test the map of friction force against velocity on a Stribeck curve."""
    law = fj.friction.Stribeck(MU, 0.065, v_stribeck=5e-3)
    truth = RIG.oscillator(law)
    runs = [
        fj.synthetic_run(truth, x0, rate=20e3, duration=0.45, noise=1e-9, seed=i)
        for i, x0 in enumerate(np.linspace(0.5e-3, 2e-3, 12))
    ]
    edges = np.concatenate([[0.0], np.geomspace(1e-3, 0.16, 25)])
    found = friction_force_map(runs, RIG, bins=edges)
    speed = np.abs(found.velocity)
    expected = found.direction * np.asarray(law.sliding_force(speed, LOAD))
    used = np.isfinite(found.force) & (speed >= 1e-3)
    inside = np.abs(found.force - expected)[used] <= 2 * found.std[used]
    near = np.argmin(np.where(used, np.abs(speed - 5e-3), np.inf))
    told = {"inside": float(np.mean(inside)), "std_at_5_mm_s": float(found.std[near] / np.abs(expected[near]))}
    print(
        f"Stribeck map: {told['inside']:.0%} of {used.sum()} ranges of velocity from 1 mm/s on within two standard "
        "deviations"
    )
    print(f"              standard deviation at 5 mm/s: {told['std_at_5_mm_s']:.2%} of the force")
    return told


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", default="", help="scenarios, stribeck, bracket or probit")
    parser.add_argument("--runs", type=int, default=36, help="runs of a campaign")
    parser.add_argument("--campaigns", type=int, default=2000, help="campaigns of the probit intervals")
    parser.add_argument("--json", type=Path, help="write the numbers to this file")
    options = parser.parse_args()
    parts = {
        "scenarios": lambda: scenarios(options.runs),
        "stribeck": stribeck,
        "bracket": bracketed,
        "probit": lambda: coverage(options.campaigns),
    }
    if options.only and options.only not in parts:
        parser.error(f"There is no part {options.only!r}. Choose from {', '.join(parts)}.")
    told = {name: part() for name, part in parts.items() if options.only in ("", name)}
    if options.json is not None:
        options.json.write_text(json.dumps(told, indent=1) + "\n")


if __name__ == "__main__":
    main()
