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
# # Uncertainty budget
#
# **My coefficient of friction has an uncertainty. What is it made of, is it true, and what would make it smaller?**
#
# The numbers of the rig, the noise of the record, and the shape of the problem each have a part in it. This notebook
# takes them apart in five ways: a budget by the GUM, its check by Monte Carlo, a profile, a bootstrap and a
# posterior.

# %%
import os

import jax

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.uncertainty import Input

FAST = os.environ.get("FRICJAX_NOTEBOOKS") == "fast"  # the tests run every notebook: fewer draws, the same steps

# %% [markdown]
# ## A run and its fit
#
# A coarse instrument this time, 0.2 um of noise, so that the noise has a part in the result.

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="1.891(2) N")
truth = fj.Oscillator(0.41068, 2574.0, 0.1756, 1.891, fj.friction.Coulomb(mu=0.02))
record = fj.synthetic_run(truth, 0.8e-3, rate=2000.0, duration=0.8, hold=0.02, noise=2e-7, seed=11)
fit = fj.fit(record, rig.oscillator(fj.friction.Coulomb(0.01)), free=["mu", "damping", "stiffness"], rig=rig)
fit.plot()

# %% [markdown]
# ## Whose fault is it?
#
# Each bar is what one input adds to the uncertainty of $\mu$.

# %%
budget = fj.uncertainty.budget(fit)
budget.plot()

# %%
budget

# %% [markdown]
# The normal force is a deadweight on a lever, which nobody knows better than its parts. A formula takes its place, in
# which each part has a distribution of its own; its inputs then stand in the table.

# %%
weight = {
    "dead_weight": Input(0.19275, 2e-5, "kg"),  # calibrated
    "gravity": Input(9.8107, 1e-4, "m/s^2"),
    "lever": Input.rectangular(1.0, 1e-3),  # a tolerance: anywhere between two ends
}
load = fj.uncertainty.propagate(
    lambda dead_weight, gravity, lever: dead_weight * gravity * lever, weight, quantity="normal force", unit="N"
)
better = fj.uncertainty.budget(fit, inputs={"normal_force": load})
better.plot()

# %%
print(f"mu = {fj.show.uncertain(budget.value, budget.std)} with the weight as one number")
print(f"mu = {fj.show.uncertain(better.value, better.std)} with its parts, true 0.02")
print(f"expanded uncertainty {better.expanded()}")

# %% [markdown]
# ## Is the budget true?
#
# A budget takes everything for straight lines. Drawing all inputs from their distributions does not (JCGM 101):

# %%
draws = better.monte_carlo(20_000 if FAST else 1_000_000)
draws.plot()

# %% [markdown]
# ## Is the optimum round?
#
# The standard errors of a fit take the record for a parabola about its optimum. A profile looks: $\mu$ is held at
# values about its optimum, everything else is fitted again, and what the record thinks of that is drawn.

# %%
profile = fj.uncertainty.profile(fit, "mu", points=5 if FAST else 16)
profile.plot()

# %%
profile

# %% [markdown]
# ## Would another record say the same?
#
# The bootstrap makes records that the same machine could have given, by shuffling the residuals in blocks, and fits
# each of them. Their scatter is the standard error, without any formula.

# %%
bootstrap = fj.uncertainty.bootstrap(fit, draws=40 if FAST else 1000)
bootstrap

# %% [markdown]
# ## And in the way of Bayes
#
# Draws from the posterior distribution of all parameters at once, by the No-U-Turn sampler (extra `bayes`). R-hat
# should be near one, the number of divergences zero.

# %%
short = {"draws": 100, "chains": 2, "warmup": 100} if FAST else {}
posterior = fj.uncertainty.posterior(fit, **short)
posterior.plot()

# %%
posterior

# %% [markdown]
# ## All of them

# %%
spread = {
    "fit": fit.std_errors["mu"],
    "profile": (profile.interval[1] - profile.interval[0]) / (2 * 1.96),
    "bootstrap": bootstrap.std["mu"],
    "posterior": posterior.std["mu"],
}
for name, std in spread.items():
    print(f"{name:<10} {std:.2e}")

# %% [markdown]
# Four ways, one answer: for this record the standard error of the fit can be believed, and the budget with it. They
# part where a parameter is badly determined, such as a Stribeck velocity from a single run; then the profile is the
# one to show.
#
# ## Next
#
# - How to choose the run so that the noise has less to say: [Sensitivity and
# design](08_sensitivity_and_design.ipynb).
# - Scatter from run to run: [Many runs at once](05_many_at_once.ipynb).
