# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A first fit
#
# **How large is the friction of this contact, and how sure can one be?**
#
# A mass on a leaf spring is pulled aside by 2 mm, let go, and slides to rest on a counterface while a laser
# interferometer watches. This notebook takes one such run from its file to a coefficient of friction with its
# uncertainty.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import jax

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj

# %% [markdown]
# ## The run
#
# No interferometer is at hand here, so a run is made up, with what a real one suffers from: 1 nm of noise, counts of
# 0.31 nm, a periodic error of 2 nm, and a magnet that takes a millisecond to let go. It is written to a file and read
# back like any other; the file could as well be your own.

# %%
truth = fj.Oscillator(
    mass=0.41068, stiffness=2574.0, damping=0.1756, normal_force=9.66, friction=fj.friction.Coulomb(mu=0.05, mu_s=0.065)
)
made = fj.synthetic_run(
    truth,
    2e-3,
    rate=20_000.0,
    duration=0.3,
    hold=0.02,
    noise=1e-9,
    quantisation=0.309e-9,
    offset=3e-6,
    release_time_constant=1e-3,
    periodic_nonlinearity=(2e-9, 0.7e-9),
    seed=7,
)
folder = TemporaryDirectory()
path = fj.write(made, Path(folder.name) / "run.csv")

record = fj.read(path)
record.plot()

# %% [markdown]
# Read the picture from left to right: the magnet holds, lets go, the mass swings to and fro, and stops where the
# spring can no longer overcome friction. Release, reversals and rest were found in the samples alone, without a
# model. What else can be said of the record before anything is fitted to it:

# %%
fj.data.inspect(record)

# %% [markdown]
# ## The model
#
# Dry friction takes the same step off the amplitude in each half-cycle, which is why the reversals lie on a straight
# line; viscous damping takes a fraction. With mass $m$, damping $c$, stiffness $k$ and normal force $N$,
#
# $$m\ddot{x} + c\dot{x} + kx + \mu N\,\mathrm{sgn}(\dot{x}) = 0.$$
#
# A trace alone tells $\mu N/k$. The coefficient $\mu$ needs the numbers of the rig, each with its standard
# uncertainty:

# %%
rig = fj.Rig(
    mass="410.68(4) g",
    stiffness="2574(2) N/m",  # a start value: the fit finds it from the frequency and the mass
    normal_force="9.66 +/- 0.5 % N",
    periodic_nonlinearity="0 +/- 1.5 nm",  # of the interferometer: its amplitude over the square root of two
)
rig

# %% [markdown]
# ## The fit
#
# Free are the dynamic coefficient, the damping and the stiffness; `rig.oscillator` gives the machine with a law of
# friction, whose values are only where the fit begins. The motion before the first reversal is left out, for there
# the magnet still pulls.

# %%
start = rig.oscillator(fj.friction.Coulomb(mu=0.1, mu_s=0.1))
fit = fj.fit(record, start, free=["mu", "mu_s", "damping", "stiffness"], rig=rig)
fit.plot()

# %%
fit

# %% [markdown]
# How to read the first line: `0.05000(25)` is the value with its combined standard uncertainty in the last two
# digits; the column beside it is what the noise of the record alone would leave, some parts in ten million. The line
# `uncertainty` says whose fault the rest is: of mu the normal force, of damping the interferometer. A longer record
# would help neither. Static friction has no gradient in a Coulomb law: it is bracketed, by the reversal at which the
# mass stayed and the last one at which it did not.

# %%
low, high = fit.intervals["mu_s"]
print(f"mu   = {fj.show.uncertain(fit.values['mu'], fit.combined_std_errors['mu'])}, true 0.05")
print(f"mu_s lies between {low:.4f} and {high:.4f}, true 0.065")

# %% [markdown]
# The line `noise` says that the residuals are 1.6 times as large as the noise that was stated. What is more is that
# periodic error, two nanometres on two millimetres, which the lower picture shows as soon as the mass moves.
#
# ## What goes wrong
#
# The same fit from the release on, as if the magnet had let go at once:

# %%
naive = fj.fit(
    record,
    rig.oscillator(fj.friction.Coulomb(mu=0.1)),
    free=["mu", "damping", "stiffness"],
    start="release",
    nuisance=["t_release", "x0", "offset"],
)
naive.plot()

# %%
off, good = (abs(each.values["mu"] / 0.05 - 1) for each in (naive, fit))
print(f"mu is {off:.1e} off, {off / good:.0f} times as far as before")
print(naive.status)

# %% [markdown]
# Nothing of this is visible in the upper half of the picture, and everything in the lower one: look at the residuals
# first. The status says the same in words, with the remedy.
#
# ## Next
#
# - Your own file, in units and formats of its own: [A pendulum of one's own](02_own_pendulum.ipynb).
# - Other ways from a run to the same coefficient: [Four routes](03_routes.ipynb).
# - Where the 0.5 % come from and what to do about it: [Uncertainty budget](07_uncertainty_budget.ipynb).
