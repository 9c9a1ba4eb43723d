"""Check noise and standard errors of records with missing samples.

Samples are missing at random or in blocks, and are deleted, masked or NaN. A row gives, for a rate, a pattern and a
share of missing samples, the median and the largest deviation of the noise level from the truth, and of the standard
errors from those of a fit with the true noise. It also gives the largest error of a converged fit in standard errors,
and counts the fits that do not converge, and the fits of a Coulomb law to records of a Stribeck contact that pass as
converged although the complete record does not.

    python experiments/honesty/gaps.py [--runs 100]
"""

import argparse
import dataclasses

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from records import MASS, RIGS  # noqa: E402

import fricjax as fj  # noqa: E402

NOISE = 20e-9
SHARES, RATES = (0.0, 0.01, 0.05, 0.2), (20e3, 5e3, 2e3, 500.0)
BLOCKS = 10  # number of blocks of missing samples
DURATION = 1.2  # of a record [s]


def missing(pattern: str, share: float, n: int, random: np.random.Generator) -> np.ndarray:
    """Return True for missing samples, shape `(n,)`."""
    if pattern == "random":
        return random.random(n) < share
    length = max(round(share * n / BLOCKS), 1)
    starts = random.integers(0, n - length, BLOCKS)
    return np.isin(np.arange(n), starts[:, None] + np.arange(length))


def incomplete(t: np.ndarray, x: np.ndarray, lost: np.ndarray, how: int, sigma: float | None) -> fj.Record:
    """Return the record without its lost samples: deleted, NaN or masked."""
    if how == 0:
        return fj.Record(t[~lost], x[~lost], sigma)
    if how == 1:
        return fj.Record(t, np.where(lost, np.nan, x), sigma)
    return fj.Record(t, x, sigma, ~lost)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100, help="records of each kind")
    runs = parser.parse_args().runs
    contact = RIGS["sliding"].oscillator
    truth = dataclasses.replace(contact, friction=fj.friction.Coulomb(0.02))
    start = dataclasses.replace(truth, friction=fj.friction.Coulomb(0.03), damping=1.5 * truth.damping)
    free = ("mu", "damping", "stiffness")
    print(f"mass {MASS:.4f} kg, noise {NOISE:.3g} m; deviations in %")
    print(
        "   rate  pattern  missing  noise: median    worst  std. errors: median    worst  error  not converged  passed"
    )
    for rate in RATES:
        t = np.arange(round(rate * DURATION)) / rate
        smooth, wrong = (np.asarray(fj.simulate(each, 2e-3, t).x) for each in (truth, contact))
        for pattern in ("random", "blocks"):
            for share in SHARES:
                random = np.random.default_rng([round(rate), round(1e3 * share), len(pattern)])
                noises, errors, pulls, failed, passed = [], [], [0.0], 0, 0
                for i in range(runs):
                    noise = NOISE * random.standard_normal(t.size)
                    lost = missing(pattern, share, t.size, random)
                    seen = fj.fit(incomplete(t, smooth + noise, lost, i % 3, None), start, free, throw=False)
                    known = fj.fit(incomplete(t, smooth + noise, lost, 0, NOISE), start, free, noise="white")
                    noises.append(seen.sigma / NOISE - 1)
                    errors += [seen.std_errors[name] / known.std_errors[name] - 1 for name in free]
                    failed += not seen.described
                    if seen.described:
                        right = {"mu": 0.02, "damping": truth.damping, "stiffness": truth.stiffness}
                        pulls += [abs(seen.values[name] - float(right[name])) / seen.std_errors[name] for name in free]
                    complete = fj.fit(fj.Record(t, wrong + noise), start, free, throw=False)
                    passed += (
                        fj.fit(incomplete(t, wrong + noise, lost, i % 3, None), start, free, throw=False).converged
                        and not complete.described
                    )
                print(
                    f"{rate:7.0f}  {pattern:7}  {share:7.0%}  {100 * np.median(noises):13.1f}  {worst(noises):7.1f}  "
                    f"{100 * np.median(errors):19.1f}  {worst(errors):7.1f}  {max(pulls):5.1f}  {failed:6}  {passed:6}",
                    flush=True,
                )


def worst(deviations: list[float]) -> float:
    return 100 * float(np.max(np.abs(deviations)))


if __name__ == "__main__":
    main()
