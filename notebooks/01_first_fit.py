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
# We pull a mass on a leaf spring aside by 2 mm and let it go. It slides on a counterface until it comes to rest, while
# a laser interferometer records its displacement. In this notebook we take one such run from its file to a coefficient
# of friction with its uncertainty.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import jax

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj

# %% [markdown]
# ## The run
#
# There is no interferometer at hand, so we simulate a run with the imperfections of a real one: 1 nm of noise, a
# resolution of 0.31 nm, a periodic error of 2 nm, and a magnet that needs a millisecond to let go. We write the run to
# a file and read it back, just as you would read your own file.

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
# Read the picture from left to right. The magnet holds the mass and lets it go. The mass oscillates, and it stops when
# the spring can no longer overcome friction. fricjax detects the release, the reversals and the rest from the samples
# alone, without a model. `inspect` summarises the record before any fit:

# %%
fj.data.inspect(record)

# %% [markdown]
# ## The model
#
# Dry friction reduces the amplitude by the same amount in each half-cycle, so the reversals lie on a straight line.
# Viscous damping reduces it by a constant fraction. With mass $m$, damping $c$, stiffness $k$ and normal force $N$,
# the equation of motion is
#
# $$m\ddot{x} + c\dot{x} + kx + \mu N\,\mathrm{sgn}(\dot{x}) = 0.$$
#
# A trace alone determines only the ratio $\mu N/k$. To obtain the coefficient $\mu$ itself, we need the properties of
# the rig, each with its standard uncertainty:

# %%
rig = fj.Rig(
    mass="410.68(4) g",
    stiffness="2574(2) N/m",  # a start value: the fit determines it from frequency and mass
    normal_force="9.66 +/- 0.5 % N",
    periodic_nonlinearity="0 +/- 1.5 nm",  # standard uncertainty: amplitude over the square root of two
)
rig

# %% [markdown]
# ## The fit
#
# We free the coefficients of friction, the damping and the stiffness. `rig.oscillator` combines the rig with a
# friction law; the values of the free parameters are only start values. The fit leaves out the motion before the first
# reversal, because the magnet still pulls there.

# %%
start = rig.oscillator(fj.friction.Coulomb(mu=0.1, mu_s=0.1))
fit = fj.fit(record, start, free=["mu", "mu_s", "damping", "stiffness"], rig=rig)
fit.plot()

# %%
fit

# %% [markdown]
# How do we read the first line? `0.05000(25)` is the value with its combined standard uncertainty in the last two
# digits. The next column is the standard error from the noise of the record alone, a few parts in ten million. The
# line `rig inputs` names the main source of the rest: the normal force for mu, and the interferometer for the damping.
# A longer record would reduce neither of them.
#
# In a Coulomb law the motion has no gradient with respect to static friction. The fit brackets it instead, between the
# reversal at which the mass stayed and the last reversal at which it slid on.

# %%
low, high = fit.intervals["mu_s"]
print(f"mu   = {fj.show.uncertain(fit.values['mu'], fit.combined_std_errors['mu'])}, true 0.05")
print(f"mu_s lies between {low:.4f} and {high:.4f}, true 0.065")

# %% [markdown]
# The line `noise` reports residuals 1.6 times as large as the stated noise. The excess is the periodic error, two
# nanometres on two millimetres. The lower panel shows it as soon as the mass moves. The periodic error also causes the
# warning about the contact; without this error in the simulation, the warning disappears.
#
# ## A common mistake
#
# We repeat the fit, but start it at the release, as if the magnet had let go at once:

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
print(f"relative error of mu: {off:.1e}, {off / good:.0f} times as large as before")
print(naive.status)

# %% [markdown]
# The upper panel shows no sign of this error, but the lower panel shows it clearly. Always look at the residuals
# first. The status describes the same problem in words, with the remedy.
#
# ## Next
#
# - Read your own file, with its units and format: [Your own pendulum](02_own_pendulum.ipynb).
# - Obtain the same coefficient in other ways: [Four routes](03_routes.ipynb).
# - Find the sources of the 0.5 %, and reduce it: [Uncertainty budget](07_uncertainty_budget.ipynb).
