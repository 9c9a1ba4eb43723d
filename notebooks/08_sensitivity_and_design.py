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
# # Sensitivity and design
#
# **From where should I release the mass, and what will the run tell, before I have made it?**
#
# The simulated motion can be differentiated, through every reversal and the stop. The derivative with respect to a
# coefficient is the shape that an error of it would leave in the record; from these shapes follows what a run will
# tell, and which run tells most.

# %%
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, figure

# %% [markdown]
# ## The shapes
#
# `jax.jacfwd` gives all derivatives of a function at once, in forward mode. Here they are of a motion, with respect
# to the coefficient of friction, the damping and the stiffness, each drawn relative to its largest value:

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="9.66 +/- 0.5 % N", damping="0.1756(20) N s/m")
machine = rig.oscillator(fj.friction.Coulomb(mu=0.05))
names = ["mu", "damping", "stiffness"]
values = jnp.array([0.05, 0.1756, 2574.0])
ts = jnp.arange(0.0, 0.35, 1e-4)


def displacement(values, x0=2.6e-3):
    mu, damping, stiffness = values
    changed = dataclasses.replace(machine, damping=damping, stiffness=stiffness, friction=fj.friction.Coulomb(mu))
    return fj.simulate(changed, x0, ts).x


x, slopes = displacement(values), jax.jacfwd(displacement)(values)  # slopes: shape (samples, 3)

drawing, axes = figure(2, 1, share_x=True)
axes[0, 0].plot(ts, 1e3 * x)
axes[0, 0].set_ylabel(axis_label("Displacement", "mm"))
for name, slope, dashes in zip(names, slopes.T, ("-", "--", ":"), strict=True):
    axes[1, 0].plot(ts, slope / jnp.max(jnp.abs(slope)), dashes, label=name, linewidth=1.5)
axes[1, 0].set(xlabel=axis_label("Time", "s"), ylabel="Derivative over its largest value")
axes[1, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
drawing

# %% [markdown]
# Stiffness shifts the phase, so its shape is a quarter of a period off the others. Friction and damping both take the
# amplitude down and look alike; what tells them apart is that friction stops the mass.
#
# ## From shapes to standard errors
#
# With white noise $\sigma$ in each sample and the shapes as columns of $J$, the covariance that a fit will have is
# $\sigma^2 (J^\top J)^{-1}$, the inverse of the Fisher information. In three lines:

# %%
noise = 5e-9  # m
covariance = noise**2 * jnp.linalg.inv(slopes.T @ slopes)
for name, value, std in zip(names, values, jnp.sqrt(jnp.diag(covariance)), strict=True):
    print(f"{name:<10} {fj.show.uncertain(float(value), float(std))}")

# %% [markdown]
# `fj.sensitivity.fisher` does the same with everything around it: scaling, the nuisances of a run, undetermined
# directions in words, and advice.

# %%
told = fj.sensitivity.fisher(machine, 2.6e-3, np.asarray(ts), names, noise=noise)
told.plot()

# %%
told

# %% [markdown]
# Nothing was measured yet, and it is known that a run will tell $\mu$ to parts in ten million, that friction and
# damping can be exchanged for each other to some degree, and that the load, not the record, will limit the result.
# The standard errors are a little larger than those of the three lines: the run's own displacement and offset are to
# be found as well.
#
# Asked for everything at once, it says what no run can tell: a trace knows only ratios and products.

# %%
print(*fj.sensitivity.fisher(machine, 2.6e-3, noise=noise).errors, sep="\n")

# %% [markdown]
# ## Which release?
#
# Larger releases tell more, though not in every case, for the stop has its part. `design` takes a target, a relative
# standard error, and counts the runs it takes from each release.

# %%
plan = fj.sensitivity.design(
    machine, np.linspace(1.0e-3, 3.0e-3, 9), {"mu": 1e-6}, names, noise=noise, rate=5000.0, duration=0.35
)
plan.plot()

# %%
plan

# %% [markdown]
# ## Static friction
#
# A stop tells only that static friction was more than what the spring asked for there, and each reversal that was
# passed that it was less. The next release is best where both outcomes are as probable. Three of them in a row, the
# first without knowing more than a range:

# %%
truth = rig.oscillator(fj.friction.Coulomb(mu=0.05, mu_s=0.0637))  # which the experimenter does not know
start = rig.oscillator(fj.friction.Coulomb(mu=0.05, mu_s=0.065))
interval = (0.05, 0.08)
for seed in range(3):
    best = fj.sensitivity.next_release(machine, x0=(1.8e-3, 3e-3), interval=interval)
    run = fj.synthetic_run(truth, best.x0, rate=5000.0, duration=0.5, hold=0.02, noise=noise, seed=seed)
    low, high = fj.fit(run, start, free=["mu", "mu_s", "stiffness"]).intervals["mu_s"]
    interval = (max(interval[0], low), min(interval[1], high))
    print(f"released from {1e3 * best.x0:.2f} mm: mu_s between {interval[0]:.4f} and {interval[1]:.4f}, true 0.0637")

# %%
best.plot()

# %% [markdown]
# ## Next
#
# - A law of one's own is differentiated like any other: [A friction law of one's own](09_own_law.ipynb).
# - What remains when the run is made: [Uncertainty budget](07_uncertainty_budget.ipynb).
