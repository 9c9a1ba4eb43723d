"""Is the friction right, and is "converged" true, on records as instruments write them?

For every kind of noise and either rig, records with a random release, offset and phase are fitted as a user would. A
row tells how often the number of half-cycles is right, or cannot be told: where another number was taken, the fit with
the true one is no worse by more than odds of 400 to 1, for residuals as correlated as they are. A record of one
half-cycle behind its first reversal is rightly refused. The error of mu is given in units of the scatter that fits with
the true number of half-cycles have over the same records.

    python experiments/honesty/run.py [--runs 100] [--rig sliding] [--only "white,AR"]
    python experiments/honesty/run.py --thresholds [--runs 5]

With `--thresholds` the thresholds of segmentation and noise are halved and doubled instead, one after the other, and a
row tells by how many standard errors that changes mu at most.
"""

import argparse
import math
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from records import ASIDE, RIGS, TUNED, Rig, Run, record  # noqa: E402

import fricjax as fj  # noqa: E402
from fricjax.data import disturbance, strokes, swing  # noqa: E402
from fricjax.data.errors import DataError, UsageError  # noqa: E402
from fricjax.fitting.fit import concluded  # noqa: E402
from fricjax.fitting.parameters import Request  # noqa: E402
from fricjax.fitting.problem import pose  # noqa: E402
from fricjax.fitting.rest import with_counts  # noqa: E402
from fricjax.fitting.solve import solve  # noqa: E402

ODDS = 2 * math.log(400)
TOO_FEW = 2  # half-cycles behind the first reversal, from which friction and the offset can both be told
THRESHOLDS = {
    strokes: ("SURE", "SOUGHT", "BELIEVED", "TINY", "STANDS_OUT", "ISOCHRONOUS", "RINGING", "CREPT", "SHORTEST_REST",
              "CREEP", "OPEN", "PER_STROKE"),
    disturbance: ("STRETCH", "RINGS", "LINE", "STROKES", "SAMPLES"),
    swing: ("SPIKE", "FEW_SPIKES"),
}  # fmt: skip


class Outcome(NamedTuple):
    """One record: the fit as a user gets it and the one with the true number, each None where it was refused."""

    run: Run
    fit: fj.Fit | None
    true: fj.Fit | None
    refusal: str

    @property
    def right(self) -> bool:
        """Whether the number is the true one, or the record was refused that holds too few to tell friction."""
        if self.fit is None:
            return self.run.half_cycles < TOO_FEW
        return self.fit.half_cycles[0] == self.run.half_cycles

    @property
    def open(self) -> bool:
        """Whether the record cannot tell the number that was taken from the true one."""
        if self.fit is None or self.true is None or self.right:
            return self.right
        variance = max(self.true.chi2_reduced, 1e-300) * max(self.true.whiteness.correlation_time, 1.0)
        return (self.true.chi2 - self.fit.chi2) / variance < ODDS

    @property
    def converged(self) -> bool:
        return self.fit is not None and self.fit.converged


def outcome(rig: Rig, run: Run, loss: str) -> Outcome:
    trace, free = fj.Trace(run.t, run.x), list(rig.free)
    fit, refusal = None, ""
    try:
        fit = fj.fit(trace, rig.oscillator, free, loss=loss, throw=False)
    except (DataError, UsageError) as error:
        refusal = str(error)
    if fit is not None and fit.half_cycles[0] == run.half_cycles:
        return Outcome(run, fit, fit, refusal)
    try:
        return Outcome(run, fit, fit_with_true_number(rig, run, loss), refusal)
    except DataError as error:
        return Outcome(run, fit, None, refusal or str(error))


def fit_with_true_number(rig: Rig, run: Run, loss: str) -> fj.Fit:
    """The fit of a record of which the number of half-cycles is known; it is posed on what is before the stop."""
    settings = {"nuisance": None, "engine": "auto", "start": "first_reversal", "bounds": None, "priors": None}
    request = Request.of(rig.oscillator, list(rig.free), tie=None, rig=None, guess=None, loss=loss, **settings)
    problem = with_counts(pose([fj.Trace(run.t, run.x)], request), (run.half_cycles,))
    return concluded(problem, solve(problem), "absolute", False)


def row(kind: str, outcomes: list[Outcome], truth: float) -> str:
    errors = np.array([o.fit.values["mu"] - truth if o.fit is not None else np.nan for o in outcomes])
    reference = np.array([o.true.values["mu"] - truth for o in outcomes if o.true is not None])
    scatter = float(np.sqrt(np.mean(reference**2)))
    converged = np.array([o.converged for o in outcomes])
    worst = np.nanmax(np.abs(errors)) / scatter
    lies = np.max(np.abs(errors[converged]), initial=0.0) / scatter
    n = len(outcomes)
    right, told = sum(o.right for o in outcomes), sum(o.right or o.open for o in outcomes)
    return (
        f"{kind:26s}{right:5d}{told - right:7d}{n - told:8d}{sum(o.fit is None for o in outcomes):9d}"
        f"{int(converged.sum()):11d}{scatter / truth:12.1e}{worst:9.1f}{lies:11.1f}"
    )


def table(rig: Rig, runs: int, wanted: list[str]) -> None:
    truth = float(rig.oscillator.friction.mu)
    for title, kinds in (("looked at while tuning", TUNED), ("kept aside", ASIDE)):
        print(f"\n{rig.name}, {runs} records a row, kinds {title}; worst error of mu in units of its scatter")
        print(
            f"{'':26s}{'right':>5s}{'open':>7s}{'wrong':>8s}{'refused':>9s}{'converged':>11s}{'scatter':>12s}"
            f"{'worst':>9s}{'of these':>11s}"
        )
        for kind in kinds:
            if any(part in kind for part in wanted):
                loss = "cauchy" if "outliers" in kind else "squares"
                outcomes = [outcome(rig, record(rig, kind, seed), loss) for seed in range(runs)]
                print(row(kind, outcomes, truth), flush=True)
                for i, o in enumerate(outcomes):
                    if not (o.right or o.open):
                        got = o.refusal or (o.fit and f"{o.fit.half_cycles[0]}: {o.fit.status}")
                        print(f"    record {i}, {o.run.half_cycles} half-cycles, got {got}"[:160], flush=True)


def fits(rig: Rig, runs: int, wanted: list[str]) -> list[fj.Fit]:
    kinds = [kind for kind in (*TUNED, *ASIDE) if any(part in kind for part in wanted)]
    pairs = [(kind, seed) for kind in kinds for seed in range(runs)]
    found = []
    for kind, seed in pairs:
        run = record(rig, kind, seed)
        found.append(fj.fit(fj.Trace(run.t, run.x), rig.oscillator, list(rig.free), throw=False))
    return found


def sensitivity(rig: Rig, runs: int, wanted: list[str]) -> None:
    """What half and twice each threshold change."""
    plain = fits(rig, runs, wanted)
    print(f"\n{rig.name}, {len(plain)} records; largest change of mu in its standard errors, as residuals scatter")
    for module, names in THRESHOLDS.items():
        for name in names:
            value, changes = getattr(module, name), []
            for factor in (0.5, 2.0):
                setattr(module, name, type(value)(value * factor))
                pairs = zip(plain, fits(rig, runs, wanted), strict=True)
                changes.append(max(abs(a.values["mu"] - b.values["mu"]) / a.std_errors["mu"] for a, b in pairs))
            setattr(module, name, value)
            print(f"{name:20s}{changes[0]:10.3f} halved{changes[1]:10.3f} doubled", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int)
    parser.add_argument("--rig", choices=sorted(RIGS))
    parser.add_argument("--only", default="", help="parts of the names of the kinds, separated by commas")
    parser.add_argument("--thresholds", action="store_true")
    arguments = parser.parse_args()
    wanted = [part.strip() for part in arguments.only.split(",")]
    for rig in (RIGS[arguments.rig],) if arguments.rig else RIGS.values():
        if arguments.thresholds:
            sensitivity(rig, arguments.runs or 5, wanted)
        else:
            table(rig, arguments.runs or 100, wanted)


if __name__ == "__main__":
    main()
