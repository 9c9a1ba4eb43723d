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
# # Many runs at once
#
# **Where does the mass stop, for a thousand releases? And what do the runs of a whole campaign say together?**
#
# A simulation is a function of numbers. `jax.vmap` turns it into a function of arrays, without a loop or a batch
# dimension to keep track of, and `jax.jit` compiles it into one program. To fit many measured runs, use
# `fj.fit_batch`.

# %%
import os
import time

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, figure

FAST = os.environ.get("FRICJAX_NOTEBOOKS") == "fast"  # the tests run fewer runs through the same steps

# %% [markdown]
# ## Final displacements
#
# One call computes one release. `jax.vmap` maps the function over an array, and `jax.jit` compiles it:

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="9.66 +/- 0.5 % N", damping="0.1756(20) N s/m")
oscillator = rig.oscillator(fj.friction.Coulomb(mu=0.05, mu_s=0.06))


@jax.jit
@jax.vmap
def final(x0):
    return fj.final_displacement(oscillator, x0)


x0 = jnp.linspace(0.0, 3e-3, 1000)
final(x0).block_until_ready()  # the first call compiles
start = time.perf_counter()
xf = final(x0).block_until_ready()
print(f"{x0.size} releases in {1e3 * (time.perf_counter() - start):.1f} ms")

drawing, axes = figure()
axes[0, 0].plot(1e3 * x0, 1e3 * xf)
axes[0, 0].set(xlabel=axis_label("Initial displacement", "mm"), ylabel=axis_label("Final displacement", "mm"))
drawing

# %% [markdown]
# An oscillator is a pytree of numbers, so we can map over any of its parameters as well. Two nested `vmap` compute a
# map of the final displacement, for coefficients of friction from 0.03 to 0.07 and a range of releases:


# %%
@jax.jit
def stops(mu, x0):
    at = lambda mu, x0: fj.final_displacement(rig.oscillator(fj.friction.Coulomb(mu)), x0)
    return jax.vmap(lambda m: jax.vmap(lambda x: at(m, x))(x0))(mu)


mu = jnp.linspace(0.03, 0.07, 200)
x0 = jnp.linspace(0.0, 3e-3, 300)
drawing, axes = figure()
extent = (0.0, 3.0, 0.03, 0.07)
image = axes[0, 0].imshow(1e3 * stops(mu, x0), origin="lower", aspect="auto", extent=extent, cmap="PuOr")
axes[0, 0].set(xlabel=axis_label("Initial displacement", "mm"), ylabel="Coefficient of friction")
axes[0, 0].grid(False)
drawing.colorbar(image, ax=axes[0, 0], label=axis_label("Final displacement", "mm"))
drawing

# %% [markdown]
# ## A campaign
#
# We simulate the runs of one rig, from different releases. The coefficient of friction scatters by 1 % from run to
# run, as it does in real contacts.

# %%
generator = np.random.default_rng(5)
n_runs = 12 if FAST else 60
scattered = 0.05 * (1 + 0.01 * generator.standard_normal(n_runs))
releases = generator.uniform(1.8e-3, 2.6e-3, n_runs)
runs = [
    fj.synthetic_run(
        rig.oscillator(fj.friction.Coulomb(mu)), x0, rate=5000.0, duration=0.5, hold=0.02, noise=5e-9, seed=seed
    )
    for seed, (mu, x0) in enumerate(zip(scattered, releases, strict=True))
]
drawing, axes = figure()
for run in runs[:12]:
    axes[0, 0].plot(run.t, 1e3 * run.x, color="#0072B2", alpha=0.4)
axes[0, 0].set(xlabel=axis_label("Time", "s"), ylabel=axis_label("Displacement", "mm"))
drawing

# %% [markdown]
# `fit_batch` fits the runs independently, on all cores, with one compiled program. A run that it cannot fit does not
# stop the others, and its row gives the reason. We add one such run.

# %%
broken = fj.Record(t=runs[0].t[:200], x=runs[0].x[:200])
batch = fj.fit_batch([*runs, broken], oscillator, free=["mu", "damping", "stiffness"], rig=rig)
batch

# %%
fitted, std = batch.values["mu"][:-1], batch.std_errors["mu"][:-1]
drawing, axes = figure()
axes[0, 0].errorbar(np.arange(n_runs), fitted, std, fmt="o", markersize=4, label="fitted")
axes[0, 0].plot(np.arange(n_runs), scattered, "x", markersize=7, label="true")
axes[0, 0].set(xlabel="Run", ylabel="Coefficient of friction")
axes[0, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, fontsize=8)
drawing

# %% [markdown]
# Every fit agrees with the truth within its noise, which is far smaller than the markers. The visible scatter is that
# of the contact. `population` estimates the mean with its standard error, and the scatter from run to run with its
# interval:

# %%
population = batch.population("mu")
print(population)

# %% [markdown]
# The combined standard error of the mean includes the 0.5 % of the normal force. This uncertainty is common to all
# runs, so averaging does not reduce it. `batch.to_dataframe()` returns the values of each run for further analysis.
#
# ## Next
#
# - Fit runs that are stored in files: [An archive](06_archive.ipynb).
# - Differentiate the simulation: [Sensitivity and design](08_sensitivity_and_design.ipynb).
# - Compute even larger batches: [On a GPU](10_on_a_gpu.ipynb).
