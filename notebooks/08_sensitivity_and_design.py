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
# **From where should I release the mass, and how much will the run reveal, before I make it?**
#
# JAX differentiates the simulated motion through every reversal and the stop. The derivative with respect to a
# coefficient is the change that a small error of this coefficient would leave in the record. From these derivatives we
# compute how precisely a run determines each coefficient, and which release is best.

# %%
import dataclasses

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, figure

# %% [markdown]
# ## Derivatives of the motion
#
# `jax.jacfwd` computes all derivatives of a function at once, in forward mode. Here we differentiate the displacement
# with respect to the coefficient of friction, the damping and the stiffness. The lower panel shows each derivative
# relative to its largest value:

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
axes[1, 0].set(xlabel=axis_label("Time", "s"), ylabel="Derivative / largest value")
axes[1, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
drawing

# %% [markdown]
# Reverse mode works too. `jax.grad` gives all derivatives of one number, such as the final displacement. `jax.vmap`
# takes many releases at once:


# %%
def rest(mu, x0):
    return fj.final_displacement(dataclasses.replace(machine, friction=fj.friction.Coulomb(mu)), x0)


releases = jnp.array([1.5e-3, 2.0e-3, 2.6e-3])
for x0, slope in zip(releases, jax.vmap(jax.grad(rest), (None, 0))(0.05, releases), strict=True):
    print(f"released from {1e3 * x0:.1f} mm: 1 % more friction moves the rest by {1e6 * slope * 5e-4:+.1f} um")

# %% [markdown]
# Stiffness shifts the phase, so its derivative is a quarter of a period out of phase with the others. Friction and
# damping both reduce the amplitude, and their derivatives look alike. They differ because friction stops the mass.
#
# ## From derivatives to standard errors
#
# Let each sample have white noise of standard deviation $\sigma$, and let the derivatives be the columns of $J$. A fit
# will then have the covariance $\sigma^2 (J^\top J)^{-1}$, the inverse of the Fisher information. Three lines compute
# it:

# %%
noise = 5e-9  # m
covariance = noise**2 * jnp.linalg.inv(slopes.T @ slopes)
for name, value, std in zip(names, values, jnp.sqrt(jnp.diag(covariance)), strict=True):
    print(f"{name:<10} {fj.show.uncertain(float(value), float(std))}")

# %% [markdown]
# ## Derivatives of an estimate
#
# `fj.estimate` is the least-squares fit as a pure function: arrays in, arrays out. `jax.jit`, `jax.vmap` and `jax.grad`
# accept it. Its derivative with respect to a fixed coefficient answers a question about the result: by how much does
# $\mu$ change if the stiffness was wrong? The natural frequency comes from the record, so the mass is free here, and
# $\mu = k x_d/N$ is proportional to the stiffness $k$:

# %%
record = displacement(values) + noise * np.random.default_rng(0).standard_normal(ts.size)


@jax.jit
def estimated_mu(stiffness):
    fixed = dataclasses.replace(machine, stiffness=stiffness)
    return fj.estimate(record, ts, fixed, ["mu", "damping", "mass"], sigma=noise).values["mu"]


mu, by_stiffness = jax.value_and_grad(estimated_mu)(2574.0)
print(f"mu = {mu:.6f}, and 1 % more stiffness changes it by {100 * by_stiffness * 25.74 / mu:.4f} %")

# %% [markdown]
# ## Before the measurement
#
# `fj.sensitivity.fisher` computes the standard errors of a planned run. It scales the parameters, includes the nuisance
# parameters of a run, describes undetermined directions in words, and gives advice.

# %%
information = fj.sensitivity.fisher(machine, 2.6e-3, np.asarray(ts), names, noise=noise)
information.plot()

# %%
information

# %% [markdown]
# Nothing has been measured yet, but we already know three things. A run will determine $\mu$ to parts in ten million.
# Friction and damping can replace each other to some degree. The load, and not the record, will limit the result. The
# standard errors are a little larger than those of the three lines, because `fisher` also estimates the initial
# displacement and the offset of the run.
#
# If we free all parameters at once, `fisher` reports those that no run can determine. A trace depends only on ratios
# and products of them:

# %%
print(*fj.sensitivity.fisher(machine, 2.6e-3, noise=noise).errors, sep="\n")

# %% [markdown]
# ## Which release?
#
# Larger releases usually give more information, but not in every case, because the stop matters too. `design` takes a
# target, a relative standard error, and computes the number of runs needed from each release.

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
# A stop shows that static friction exceeds the force of the spring at that point. Each reversal that the mass passes
# shows that static friction is smaller than the force there. The next release is best if both outcomes are equally
# probable. We make three such releases in a row and begin with a wide range for $\mu_s$:

# %%
truth = rig.oscillator(fj.friction.Coulomb(mu=0.05, mu_s=0.0637))  # unknown to the experimenter
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
# - Differentiate a law that you have written: [Your own friction law](09_own_law.ipynb).
# - Analyse the uncertainty after the run: [Uncertainty budget](07_uncertainty_budget.ipynb).
