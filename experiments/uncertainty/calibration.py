"""Simulation-based calibration of the posterior over runs.

    python experiments/uncertainty/calibration.py [--campaigns 200]

Each campaign draws mean and scatter from their priors, makes six runs with that scatter, fits them and draws from the
posterior. The ranks of the true values among the draws are uniform if, and only if, model, sampler and standard errors
are all correct (Talts et al., arXiv:1804.06788, 2018). The script prints their histograms with chi^2.
"""

import argparse

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from scipy.stats import chi2  # noqa: E402

import fricjax as fj  # noqa: E402

RUNS, BINS = 6, 10
# Prior mean and standard deviation of the mean, and scale of the prior of the scatter, for polymer on steel.
MEAN, WIDTH, SCALE = 0.02, 5e-4, 3e-4
# Thinning makes the draws independent, as the test of uniform ranks requires.
DRAWS, THINNED = 400, 99


def ranks(values, errors, truths, draws=DRAWS, thinned=THINNED):
    """Return ranks of the true mean and scatter among the draws.

    Ranks are from 0 to `thinned`, with shape (campaigns, 2).
    """
    found = []
    for y, u, true in zip(values, errors, truths, strict=True):
        prior = {"mean": (MEAN, WIDTH), "scatter": SCALE, "draws": draws, "chains": 2, "warmup": draws}
        drawn = fj.uncertainty.hierarchical((y, u), **prior)
        at = np.linspace(0, 2 * draws - 1, thinned).round().astype(int)
        pairs = zip((drawn.mean, drawn.scatter), true, strict=True)
        found.append([int(np.sum(each.ravel()[at] < value)) for each, value in pairs])
    return np.array(found)


def chi_square(found, bins=BINS, thinned=THINNED):
    """Count ranks in bins and compute the p-value of uniform ranks."""
    counts = np.histogram(found, bins=bins, range=(-0.5, thinned + 0.5))[0]
    expected = found.size / bins
    return counts, float(chi2.sf(np.sum((counts - expected) ** 2 / expected), bins - 1))


def truths_of(campaigns, rng):
    return np.column_stack([MEAN + WIDTH * rng.standard_normal(campaigns), SCALE * abs(rng.standard_normal(campaigns))])


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=200)
    from run import FREE, machine, record

    campaigns, rng = parser.parse_args().campaigns, np.random.default_rng(11)
    truths = truths_of(campaigns, rng)
    runs = [record(rng, mean + scatter * rng.standard_normal()) for mean, scatter in truths for _ in range(RUNS)]
    fits = fj.fit_batch(runs, machine(), FREE)
    values, errors = (each["mu"].reshape(campaigns, RUNS) for each in (fits.values, fits.std_errors))
    found = ranks(values, errors, truths)
    for name, each in zip(("mean", "scatter"), found.T, strict=True):
        counts, probability = chi_square(each)
        print(f"{name:8s} ranks in {BINS} bins: {' '.join(map(str, counts))}, probability of chi^2 {probability:.2f}")


if __name__ == "__main__":
    main()
