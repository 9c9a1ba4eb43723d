"""Coverage of the error bars, and their computing time.

    python experiments/uncertainty/run.py [--campaigns 500]

Each campaign draws a machine, its noise and the errors of its calibration. The script prints the share of campaigns
with intervals of 95 and 68 % that contain the true mu. For comparison it prints the same shares for standard errors
that assume white noise and an exact rig. Fits of one record count with every status. A second line counts only
converged fits. Times are those of warm calls. Run nothing else at the same time.
"""

import argparse
import time

import jax

jax.config.update("jax_enable_x64", True)

import numpy as np  # noqa: E402
from scipy.signal import lfilter  # noqa: E402
from scipy.stats import t as student  # noqa: E402

import fricjax as fj  # noqa: E402

MASS, STIFFNESS, LOAD, DAMPING, MU = 0.41068, 2574.0, 1.89, 0.1756, 0.02
FREE = ["mu", "damping", "stiffness"]
RUN = {"rate": 5e3, "duration": 2.0}
RUNS_OF_A_CAMPAIGN = 6
# Half-widths of intervals of 95 and 68 %, in standard errors.
WIDE, NARROW = 1.959964, 0.994458
# Floor motion of class VC-C [m/s], and the length of a record on it [s].
VC_C, SHAKEN = 12.5e-6, 3.0
SPREAD = {"stiffness": 1e-2, "load": 5e-3}


def machine(mu=MU, stiffness=STIFFNESS, load=LOAD):
    return fj.Oscillator(MASS, stiffness, DAMPING, load, fj.friction.Coulomb(mu))


def record(rng, mu=MU, noise=5e-9):
    x0 = rng.uniform(1.5e-3, 2.5e-3)
    return fj.synthetic_run(machine(mu), x0, noise=noise, seed=int(rng.integers(2**31)), **RUN)


def coloured(rng):
    """Simulate a run with AR(1) noise of 0.9.

    The shocks have a standard deviation of 20 nm.
    """
    run = record(rng, noise=0.0)
    noise = np.asarray(lfilter([1.0], [1.0, -0.9], 20e-9 * rng.standard_normal(len(run))))
    return fj.Record(run.t, run.x + noise)


def vibration(rng, samples, rate):
    """Draw the acceleration of a floor of class VC-C [m/s^2].

    Class VC-C is 12.5 um/s rms in each third of an octave from 1 to 80 Hz.
    """
    frequency = np.fft.rfftfreq(samples, 1 / rate)
    inside = (frequency >= 1) & (frequency <= 80)
    width = (2 ** (1 / 6) - 2 ** (-1 / 6)) * frequency[inside]
    density = (2 * np.pi * frequency[inside] * VC_C) ** 2 / width
    spectrum = np.zeros(frequency.size, complex)
    spectrum[inside] = np.sqrt(density * rate * samples / 4) * (rng.standard_normal((2, inside.sum())).T @ [1, 1j])
    return np.fft.irfft(spectrum, samples)


def shaken(rng):
    """Simulate a run on a floor of class VC-C.

    The record includes the rest, which separates floor motion from a wrong law.
    """
    t = np.arange(int(RUN["rate"] * SHAKEN)) / RUN["rate"]
    floor = vibration(rng, t.size, RUN["rate"])
    motion = fj.simulate(machine(), rng.uniform(1.5e-3, 2.5e-3), t, base_acceleration=floor)
    return fj.Record(t, np.asarray(motion.x) + 5e-9 * rng.standard_normal(t.size))


def covered(values, stds, plain, truth=MU, quantiles=(WIDE, NARROW)):
    """Compute the percentage of intervals that contain the truth.

    `stds` are the reported and `plain` the plain standard errors.
    """
    off = np.abs(np.asarray(values) - truth)
    return [100 * np.mean(off <= q * np.asarray(each)) for each in (stds, plain) for q in quantiles]


def by_record(make, campaigns, rng):
    fits = fj.fit_batch([make(rng) for _ in range(campaigns)], machine(), FREE)
    columns = [each["mu"] for each in (fits.values, fits.std_errors, fits.white_std_errors)]
    yield "", covered(*columns)
    if not fits.described.all():
        yield f"  {fits.described.sum()} that converged", covered(*(each[fits.described] for each in columns))


def by_calibration(campaigns, rng):
    """Fit under calibration errors of stiffness and load.

    Each campaign draws them from their standard uncertainties. The moving mass is fitted.
    """
    values, stds, plain = [], [], []
    for _ in range(campaigns):
        seen = {name: 1 + std * rng.standard_normal() for name, std in SPREAD.items()}
        rig = fj.Rig(
            mass=MASS,
            stiffness=fj.Measured(STIFFNESS * seen["stiffness"], SPREAD["stiffness"] * STIFFNESS),
            normal_force=fj.Measured(LOAD * seen["load"], SPREAD["load"] * LOAD),
            damping=DAMPING,
        )
        fit = fj.fit(record(rng), rig.oscillator(fj.friction.Coulomb(MU)), ["mu", "damping", "mass"], rig=rig)
        budget = fj.uncertainty.budget(fit)
        values.append(budget.value)
        stds.append(budget.std)
        plain.append(fit.std_errors["mu"])
    yield "", covered(values, stds, plain)


def by_scatter(campaigns, rng):
    """Average campaigns of six runs; mu scatters by 1 %."""
    runs = [record(rng, MU * (1 + 0.01 * rng.standard_normal())) for _ in range(campaigns * RUNS_OF_A_CAMPAIGN)]
    fits = fj.fit_batch(runs, machine(), FREE)
    by_campaign = (each.reshape(campaigns, -1) for each in (fits.values["mu"], fits.std_errors["mu"]))
    means, stds, plain = [], [], []
    for values, errors in zip(*by_campaign, strict=True):
        found = fj.fitting.population.population(values, errors)
        means.append(found.mean)
        stds.append(found.std)
        plain.append(np.mean(errors) / np.sqrt(RUNS_OF_A_CAMPAIGN))
    quantiles = [float(student.ppf(level, RUNS_OF_A_CAMPAIGN - 1)) for level in (0.975, 0.84)]
    yield "", covered(means, stds, plain, quantiles=quantiles)


def coverage(campaigns):
    print(f"\nCoverage of mu over {campaigns} campaigns [%]        95 %    68 %   plain: 95 %    68 %")
    rng = np.random.default_rng(7)
    rows = {
        "white noise of 5 nm": lambda: by_record(record, campaigns, rng),
        "AR(1) noise of 0.9": lambda: by_record(coloured, campaigns, rng),
        "floor of class VC-C": lambda: by_record(shaken, campaigns, rng),
        "stiffness 1 %, load 0.5 % off": lambda: by_calibration(campaigns, rng),
        "mu scatters by 1 %, six runs": lambda: by_scatter(campaigns, rng),
    }
    for name, row in rows.items():
        for part, (wide, narrow, plain_wide, plain_narrow) in row():
            print(f"  {part or name:40s} {wide:8.1f} {narrow:7.1f} {plain_wide:13.1f} {plain_narrow:7.1f}", flush=True)


def timed(call):
    call()
    started = time.perf_counter()
    result = call()
    return time.perf_counter() - started, result


def times():
    rig = fj.Rig(
        mass=fj.Measured(MASS, 1e-4), stiffness=STIFFNESS, normal_force=fj.Measured(LOAD, 5e-3), damping=DAMPING
    )
    fit = fj.fit(record(np.random.default_rng(1)), rig.oscillator(fj.friction.Coulomb(MU)), FREE, rig=rig)
    budget = fj.uncertainty.budget(fit)
    rows = []
    seconds, check = timed(budget.monte_carlo)
    rows.append((f"Monte Carlo of a budget, {check.draws} draws", seconds, "(10)"))
    seconds, sample = timed(lambda: fj.uncertainty.bootstrap(fit, 1000))
    ratio = sample.std["mu"] / fit.std_errors["mu"]
    rows.append(("1000 bootstrap fits", seconds, f"(4), mu scatters by {ratio:.3f} of its error"))
    seconds, profile = timed(lambda: fj.uncertainty.profile(fit, "mu"))
    width = (profile.interval[1] - profile.interval[0]) / (2 * WIDE * fit.std_errors["mu"])
    rows.append((f"profile of mu, {profile.at.size} fits", seconds, f"{width:.5f} as wide as its error says"))
    started = time.perf_counter()
    drawn = fj.uncertainty.posterior(fit)
    seconds = time.perf_counter() - started
    worst, least = max(drawn.r_hat.values()), min(drawn.effective.values())
    met = f"(60), R-hat <= {worst:.3f} (1.01), effective draws >= {least:.0f} (400), {drawn.divergences} divergences"
    rows.append((f"posterior, 4 chains of {drawn.sample.shape[1]}, with compilation", seconds, met))
    for name, seconds, rest in rows:
        print(f"  {name:50s} {seconds:7.2f} s  {rest}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--campaigns", type=int, default=500)
    campaigns = parser.parse_args().campaigns
    times()
    if campaigns:
        coverage(campaigns)


if __name__ == "__main__":
    main()
