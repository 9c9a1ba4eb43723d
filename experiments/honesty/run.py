"""Check friction and the status "converged" on realistic records.

For every kind of noise and both rigs, records with random release, offset and phase are fitted as a user would fit
them. A row of the table counts records with the right number of half-cycles, and records with an open number. The
number is open if the fit with the true number is worse by odds of at most 400 to 1, given the correlation of the
residuals. A refusal is right for a record with at most one half-cycle after its first reversal. Errors of mu are in
units of the scatter of fits with the true number of half-cycles over the same records.

    python experiments/honesty/run.py [--runs 100] [--rig sliding] [--only "white,AR"]
    python experiments/honesty/run.py --bars [--runs 200]
    python experiments/honesty/run.py --inputs [--runs 60]
    python experiments/honesty/run.py --thresholds [--runs 5]

With `--bars` a row gives the share of intervals of mu, damping and stiffness that contain the truth, the standard
deviation of the errors in standard errors, the largest error of a converged fit, and the ratio of the standard errors
to the Cramer-Rao bound of that noise, if known. It also counts refused records and fits with another status.

With `--inputs` each record has a random instrument error that only the rig describes. A row gives the share of combined
intervals that contain the truth, the standard deviation of the errors in combined and in statistical standard errors,
and the size of the combined standard errors.

With `--thresholds` each threshold of segmentation and noise is halved and doubled in turn. A row gives the largest
change of mu in standard errors.
"""

import argparse
import math
from typing import NamedTuple

import jax

jax.config.update("jax_enable_x64", True)

import equinox as eqx  # noqa: E402
import numpy as np  # noqa: E402
from records import ASIDE, INPUTS, KNOWN, RECORDED, RIGS, TUNED, Rig, Run, read_with, record  # noqa: E402

import fricjax as fj  # noqa: E402
from fricjax.data.segmentation import disturbance, half_cycles, stop, swing  # noqa: E402
from fricjax.errors import DataError, UsageError  # noqa: E402
from fricjax.fitting import fit_on_moving_floor  # noqa: E402
from fricjax.fitting.fit import concluded  # noqa: E402
from fricjax.fitting.parameters import Request  # noqa: E402
from fricjax.fitting.problem import Problem, build_problem  # noqa: E402
from fricjax.fitting.residual import Residual  # noqa: E402
from fricjax.fitting.rest import with_counts  # noqa: E402
from fricjax.fitting.solve import checking, solve  # noqa: E402

ODDS = 2 * math.log(400)
BOUNDED = 10  # records of a kind for which the Cramer-Rao bound is computed
TOO_FEW = 2  # half-cycles after the first reversal that friction and offset require
THRESHOLDS = {
    half_cycles: ("SURE", "SOUGHT", "BELIEVED", "TINY", "ISOCHRONOUS", "PER_HALF_CYCLE"),
    stop: ("STANDS_OUT", "RINGING", "CREPT", "SHORTEST_REST", "CREEP", "OPEN"),
    disturbance: ("STRETCH", "RINGS", "LINE", "HALF_CYCLES", "SAMPLES"),
    swing: ("SPIKE", "FEW_SPIKES"),
}  # fmt: skip


class Outcome(NamedTuple):
    """Fits of one record, each None if refused.

    Attributes:
        run: the record.
        fit: fit as a user gets it.
        true: fit with the true number of half-cycles.
        refusal: error message of the refusal.
    """

    run: Run
    fit: fj.Fit | None
    true: fj.Fit | None
    refusal: str

    @property
    def right(self) -> bool:
        """Return True if the number is right or a refusal is justified.

        A refusal is justified if the record has too few half-cycles to determine friction.
        """
        if self.fit is None:
            return self.run.half_cycles < TOO_FEW
        return self.fit.half_cycles[0] == self.run.half_cycles

    @property
    def open(self) -> bool:
        """Return True if fitted and true number describe the record equally well."""
        if self.fit is None or self.true is None or self.right:
            return self.right
        variance = max(self.true.chi2_reduced, 1e-300) * max(self.true.whiteness.correlation_time, 1.0)
        return (self.true.chi2 - self.fit.chi2) / variance < ODDS

    @property
    def converged(self) -> bool:
        return self.fit is not None and self.fit.described


def fitted(rig: Rig, run: Run, kind: str) -> fj.Fit:
    """Fit a record as a user would.

    If the acceleration of the floor is recorded, the fit uses it.
    """
    trace, settings = fj.Trace(run.t, run.x), {"loss": loss_for(kind), "throw": False}
    if kind == RECORDED:
        return fit_on_moving_floor(trace, run.floor, rig.oscillator, rig.free, **settings)
    return fj.fit(trace, rig.oscillator, rig.free, **settings)


def loss_for(kind: str) -> str:
    return "cauchy" if "outliers" in kind else "squares"


def outcome(rig: Rig, run: Run, kind: str) -> Outcome:
    fit, refusal, loss = None, "", loss_for(kind)
    try:
        fit = fitted(rig, run, kind)
    except (DataError, UsageError) as error:
        refusal = str(error)
    if fit is not None and fit.half_cycles[0] == run.half_cycles:
        return Outcome(run, fit, fit, refusal)
    try:
        return Outcome(run, fit, fit_with_true_number(rig, run, loss), refusal)
    except DataError as error:
        return Outcome(run, fit, None, refusal or str(error))


def fit_with_true_number(rig: Rig, run: Run, loss: str) -> fj.Fit:
    """Fit a record with its known number of half-cycles.

    The problem covers only the samples before the stop.
    """
    problem = posed(rig, run, loss)
    return concluded(problem, solve(problem), "absolute", False)


def posed(rig: Rig, run: Run, loss: str, guess: dict[str, float] | None = None) -> Problem:
    """Build the problem with the true number of half-cycles."""
    settings = {"nuisance": None, "engine": "auto", "start": "first_reversal", "bounds": None, "priors": None}
    request = Request.of(rig.oscillator, list(rig.free), tie=None, rig=None, guess=guess, loss=loss, **settings)
    return with_counts(build_problem([fj.Trace(run.t, run.x)], request), (run.half_cycles,))


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
    for title, kinds in (("used for tuning", TUNED), ("not used for tuning", ASIDE)):
        print(f"\n{rig.name}, {runs} records a row, kinds {title}; worst error of mu in units of its scatter")
        print(
            f"{'':26s}{'right':>5s}{'open':>7s}{'wrong':>8s}{'refused':>9s}{'converged':>11s}{'scatter':>12s}"
            f"{'worst':>9s}{'of these':>11s}"
        )
        for kind in kinds:
            if any(part in kind for part in wanted):
                outcomes = [outcome(rig, record(rig, kind, seed), kind) for seed in range(runs)]
                print(row(kind, outcomes, truth), flush=True)
                for i, o in enumerate(outcomes):
                    if not (o.right or o.open):
                        got = o.refusal or (o.fit and f"{o.fit.half_cycles[0]}: {o.fit.status}")
                        print(f"    record {i}, {o.run.half_cycles} half-cycles, got {got}"[:160], flush=True)


def bound(rig: Rig, run: Run, found: fj.Fit, kind: str) -> np.ndarray:
    """Compute the Cramer-Rao bound of the free coefficients under the true noise.

    It is NaN for kinds without a known noise law.
    """
    if kind not in KNOWN:
        return np.full(len(rig.free), np.nan)
    problem = posed(rig, run, "squares", {name: float(found.values[name]) for name in rig.free})
    window, solved = problem.windows[0], solve(problem)
    used = np.flatnonzero(window.used)
    weighted = np.asarray(derivatives(checking(problem.residual, solved.y), solved.y))[used]
    columns = weighted * window.sigma[used, None] / np.asarray(solved.derived.slope)
    model = run.x[used] - found.residuals[used]
    white = KNOWN[kind](run.t[used] - run.t[used].mean(), model, columns)
    size = np.linalg.norm(white, axis=0)
    information = (white / size).T @ (white / size)
    return (np.sqrt(np.diag(np.linalg.inv(information))) / size)[: len(rig.free)]


@eqx.filter_jit
def derivatives(residual: Residual, y: jax.Array) -> jax.Array:
    return jax.jacfwd(residual)(y)


def bars(rig: Rig, runs: int, wanted: list[str]) -> None:
    """Print coverage and size of the intervals."""
    truth = true_values(rig)
    for title, kinds in (("used for tuning", TUNED), ("not used for tuning", ASIDE)):
        print(f"\n{rig.name}, {runs} records a row, kinds {title}; each for {', '.join(rig.free)}")
        print(
            f"{'':26s}{'refused':>8s}{'other':>6s}{'cover 95 %':>17s}{'cover 68 %':>17s}{'sd of z':>16s}"
            f"{'largest converged':>19s}{'over the bound':>16s}"
        )
        for kind in kinds:
            if not any(part in kind for part in wanted):
                continue
            scores, converged, over, refused = [], [], [], 0
            for seed in range(runs):
                run = record(rig, kind, seed)
                try:
                    found = fitted(rig, run, kind)
                except (DataError, UsageError):
                    refused += 1
                    continue
                errors = np.array([found.std_errors[name] for name in rig.free])
                scores.append([(found.values[name] - truth[name]) / found.std_errors[name] for name in rig.free])
                converged.append(found.described)
                if seed < BOUNDED and found.half_cycles[0] == run.half_cycles:
                    over.append(errors / bound(rig, run, found, kind))
            z, right = np.abs(scores), np.array(converged)
            told = [np.mean(z < 1.96, axis=0), np.mean(z < 0.9945, axis=0), np.sqrt(np.mean(z**2, axis=0))]
            told += [np.max(z[right], axis=0, initial=0.0), np.median(over, axis=0)]
            words = [
                "  " + " ".join(f"{value:.{d}f}" for value in row) for row, d in zip(told, (2, 2, 2, 1, 2), strict=True)
            ]
            print(f"{kind:26s}{refused:8d}{int(np.sum(~right)):6d}" + "".join(f"{w:>17s}" for w in words), flush=True)


def true_values(rig: Rig) -> dict[str, float]:
    return {
        name: float(getattr(rig.oscillator.friction if name == "mu" else rig.oscillator, name)) for name in rig.free
    }


def inputs(rig: Rig, runs: int, wanted: list[str]) -> None:
    """Print coverage of the combined intervals under instrument errors."""
    truth, machine = true_values(rig), rig.oscillator
    numbers = {name: float(getattr(machine, name)) for name in ("mass", "stiffness", "damping", "normal_force")}
    print(f"\n{rig.name}, {runs} records a row; each for {', '.join(rig.free)}")
    print(
        f"{'':26s}{'refused':>8s}{'other':>6s}{'cover 95 %':>17s}{'cover 68 %':>17s}{'sd of z':>17s}"
        f"{'without the rig':>24s}{'relative standard errors':>27s}"
    )
    for kind, given in INPUTS.items():
        if not any(part in kind for part in wanted):
            continue
        errors, combined, statistical, other, refused = [], [], [], 0, 0
        for seed in range(runs):
            run = read_with(rig, kind, seed)
            try:
                found = fj.fit(
                    fj.Trace(run.t, run.x), machine, list(rig.free), rig=fj.Rig(**numbers, **given), throw=False
                )
            except (DataError, UsageError):
                refused += 1
                continue
            other += not found.described
            errors.append([found.values[name] - truth[name] for name in rig.free])
            combined.append([found.combined_std_errors[name] for name in rig.free])
            statistical.append([found.std_errors[name] for name in rig.free])
        z, alone = np.divide(errors, combined), np.divide(errors, statistical)
        told = [np.mean(np.abs(z) < 1.96, axis=0), np.mean(np.abs(z) < 0.9945, axis=0), np.sqrt(np.mean(z**2, axis=0))]
        relative = np.median(combined, axis=0) / np.array(list(truth.values()))
        words = [" ".join(f"{value:.2f}" for value in row) for row in told]
        words += [" ".join(f"{value:.1f}" for value in np.sqrt(np.mean(alone**2, axis=0)))]
        words += [" ".join(f"{value:.1e}" for value in relative)]
        widths = (17, 17, 17, 24, 27)
        print(
            f"{kind:26s}{refused:8d}{other:6d}" + "".join(f"{w:>{n}s}" for w, n in zip(words, widths, strict=True)),
            flush=True,
        )


def fits(rig: Rig, runs: int, wanted: list[str]) -> list[fj.Fit]:
    kinds = [kind for kind in (*TUNED, *ASIDE) if any(part in kind for part in wanted)]
    pairs = [(kind, seed) for kind in kinds for seed in range(runs)]
    found = []
    for kind, seed in pairs:
        run = record(rig, kind, seed)
        found.append(fj.fit(fj.Trace(run.t, run.x), rig.oscillator, list(rig.free), throw=False))
    return found


def sensitivity(rig: Rig, runs: int, wanted: list[str]) -> None:
    """Print changes of mu if thresholds are halved or doubled."""
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
    parser.add_argument("--bars", action="store_true")
    parser.add_argument("--inputs", action="store_true")
    parser.add_argument("--thresholds", action="store_true")
    arguments = parser.parse_args()
    wanted = [part.strip() for part in arguments.only.split(",")]
    for rig in (RIGS[arguments.rig],) if arguments.rig else RIGS.values():
        if arguments.thresholds:
            sensitivity(rig, arguments.runs or 5, wanted)
        elif arguments.bars:
            bars(rig, arguments.runs or 200, wanted)
        elif arguments.inputs:
            inputs(rig, arguments.runs or 60, wanted)
        else:
            table(rig, arguments.runs or 100, wanted)


if __name__ == "__main__":
    main()
