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
# The uncertainty comes from the properties of the rig, the noise of the record, and the model, which is not linear. We
# analyse it in five ways: a budget by the GUM, its check by Monte Carlo, a profile, a bootstrap and a posterior.

# %%
import os

import jax

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.uncertainty import Input

FAST = os.environ.get("FRICJAX_NOTEBOOKS") == "fast"  # the tests take fewer draws through the same steps

# %% [markdown]
# ## A run and its fit
#
# This time the instrument is coarse. Its noise of 0.2 um contributes to the uncertainty of the result.

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="1.891(2) N")
truth = fj.Oscillator(0.41068, 2574.0, 0.1756, 1.891, fj.friction.Coulomb(mu=0.02))
record = fj.synthetic_run(truth, 0.8e-3, rate=2000.0, duration=0.8, hold=0.02, noise=2e-7, seed=11)
fit = fj.fit(record, rig.oscillator(fj.friction.Coulomb(0.01)), free=["mu", "damping", "stiffness"], rig=rig)
fit.plot()

# %% [markdown]
# ## The contributions
#
# Each bar is the contribution of one input to the uncertainty of $\mu$.

# %%
budget = fj.uncertainty.budget(fit)
budget.plot()

# %%
budget

# %% [markdown]
# The normal force comes from a dead weight on a lever, and we know it only through these parts. We replace the single
# number by a formula, in which each part has a separate distribution. The budget then lists the parts.

# %%
weight = {
    "dead_weight": Input(0.19275, 2e-5, "kg"),  # calibrated
    "gravity": Input(9.8107, 1e-4, "m/s^2"),
    "lever": Input.rectangular(1.0, 1e-3),  # a tolerance: any value between two limits
}
load = fj.uncertainty.propagate(
    lambda dead_weight, gravity, lever: dead_weight * gravity * lever, weight, quantity="normal force", unit="N"
)
better = fj.uncertainty.budget(fit, inputs={"normal_force": load})
better.plot()

# %%
print(f"mu = {fj.show.uncertain(budget.value, budget.std)} with the normal force as one number")
print(f"mu = {fj.show.uncertain(better.value, better.std)} with its parts, true 0.02")
print(f"expanded uncertainty {better.expanded()}")

# %% [markdown]
# ## Is the budget correct?
#
# A budget linearises the model. Monte Carlo draws all inputs from their distributions instead, and does not linearise
# (JCGM 101):

# %%
draws = better.monte_carlo(20_000 if FAST else 1_000_000)
draws.plot()

# %% [markdown]
# ## Is the optimum parabolic?
#
# The standard errors of a fit assume that $\chi^2$ is a parabola about the optimum. A profile tests this assumption.
# It holds $\mu$ at values around the optimum, fits all other parameters again, and plots the excess of $\chi^2$.

# %%
profile = fj.uncertainty.profile(fit, "mu", points=5 if FAST else 16)
profile.plot()

# %%
profile

# %% [markdown]
# ## Would another record agree?
#
# The bootstrap makes records that the same machine could have given: it shuffles the residuals in blocks. It then fits
# each new record. The scatter of the results is an estimate of the standard error that needs no formula.

# %%
bootstrap = fj.uncertainty.bootstrap(fit, draws=40 if FAST else 1000)
bootstrap

# %% [markdown]
# ## The Bayesian posterior
#
# The No-U-Turn sampler draws from the joint posterior distribution of all parameters (extra `bayes`). R-hat should be
# close to one, and the number of divergences should be zero.

# %%
short = {"draws": 100, "chains": 2, "warmup": 100} if FAST else {}
posterior = fj.uncertainty.posterior(fit, **short)
posterior.plot()

# %%
posterior

# %% [markdown]
# ## All standard errors
#
# We print the standard error of mu from each method:

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
# The four methods agree. For this record we can trust the standard error of the fit, and the budget with it. The
# methods differ if a parameter is poorly determined, such as a Stribeck velocity from a single run. In that case, show
# the profile.
#
# ## Next
#
# - Choose the run so that the noise matters less: [Sensitivity and design](08_sensitivity_and_design.ipynb).
# - Estimate the scatter from run to run: [Many runs at once](05_many_at_once.ipynb).
