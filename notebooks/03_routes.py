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
# # Four routes
#
# **The fit of the trace gives a coefficient of friction. Do other ways of reading the same runs agree with it?**
#
# A wrong model can fit a trace well. It is much less likely to agree with four different evaluations of the same runs.
# These use the whole trace, the start and end of each run, the triangle map of these pairs, and the energy loss. If
# the four routes disagree, the model is wrong.

# %%
import jax
import numpy as np
from matplotlib import colormaps

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, figure

# %% [markdown]
# ## The runs
#
# We simulate a dozen releases of one rig, from 1.1 mm to 2.6 mm, with 5 nm of noise. Static friction is a third larger
# than dynamic friction.

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="9.66 +/- 0.5 % N", damping="0.1756(20) N s/m")
truth = rig.oscillator(fj.friction.Coulomb(mu=0.05, mu_s=0.0665))
releases = np.linspace(1.1e-3, 2.6e-3, 12)
runs = [
    fj.synthetic_run(truth, x0, rate=5000.0, duration=0.5, hold=0.02, noise=5e-9, seed=i)
    for i, x0 in enumerate(releases)
]

drawing, axes = figure(1, 2)
left, right = axes[0]
for run, colour in zip(runs, colormaps["viridis"](np.linspace(0.0, 0.9, 12)), strict=True):
    left.plot(run.t, 1e3 * run.x, color=colour)
left.set(xlabel=axis_label("Time", "s"), ylabel=axis_label("Displacement", "mm"))

ends = [run.segmentation.rest_position for run in runs]
fine = np.linspace(0.0, 2.7e-3, 800)
computed = jax.vmap(lambda x0: fj.final_displacement(truth, x0))(fine)
right.plot(1e3 * fine, 1e3 * computed, color="0.6", label="computed")
right.plot(1e3 * releases, 1e3 * np.array(ends), "o", label="measured")
right.set(
    xlabel=axis_label("Initial displacement", "mm"), ylabel=axis_label("Final displacement", "mm"), ylim=(-0.3, 0.4)
)
right.legend(loc="upper left", ncols=2, fontsize=8)
drawing

# %% [markdown]
# The right panel shows the data for the second and third route. The farther we pull the mass, the more half-cycles it
# makes. Its final displacement rises and falls in triangles, with one line per number of half-cycles. The half-width
# $x_d = \mu N/k$ of the dead band sets the width and height of these lines, so they determine $\mu$. Static friction
# is larger than dynamic friction and holds the mass early. The lines therefore break off, and their ends determine
# $\mu_s$.
#
# ## All routes at once

# %%
agreement = fj.compare_routes(runs, rig)
agreement

# %% [markdown]
# The four routes give the same coefficient. Their standard errors include only the noise. The uncertainty of the
# normal force, 0.5 %, is common to all routes and cannot make them differ. We now look at each route in turn.
#
# ## Route 1: the traces
#
# Runs with so few half-cycles hardly distinguish damping from friction, so we use the damping of the rig.

# %%
fj.fit_batch(runs, truth, free=["mu", "stiffness"])

# %% [markdown]
# ## Routes 2 and 3: the start and end of the runs
#
# `pairs_of` takes the first reversal as the start, because a slow release cannot bias it. The pairs also bracket
# static friction. Each stop gives a lower bound, and each reversal that the mass passed gives an upper bound.

# %%
pairs = fj.pairs_of(runs)
second = fj.fit_final_displacements(pairs.x0, pairs.xf, rig.oscillator(fj.friction.Coulomb(0.04)), free=["mu", "mu_s"])
second.plot()

# %%
third = fj.fit_triangle_map(pairs.x0, pairs.xf, rig, half_cycles=pairs.half_cycles)
low, high = second.intervals["mu_s"]
print(f"pairs:        mu = {fj.show.uncertain(second.values['mu'], second.std_errors['mu'])}")
print(f"triangle map: mu = {fj.show.uncertain(third.values['mu'], third.std_errors['mu'])}")
print(f"mu_s lies between {low:.5f} and {high:.5f}, true 0.0665")

# %% [markdown]
# A dozen runs determine static friction to within a few percent.
# [Sensitivity and design](08_sensitivity_and_design.ipynb) shows how to choose the releases so that three runs are
# enough.
#
# ## Route 4: the energy
#
# Potential and kinetic energy fall by the work of friction. From this we obtain the friction force against velocity,
# sample by sample and without a friction law. A Stribeck curve would be visible in this picture.

# %%
force_map = fj.friction_force_map(runs, rig, bins=12)
force_map.plot()

# %% [markdown]
# ## When the routes disagree
#
# We evaluate the same runs with a damping that is a tenth too small, as if the rig had been calibrated in a draught.
# Each route attributes the missing loss to friction in a different way, so the coefficients disagree:

# %%
doubtful = fj.compare_routes(runs, rig.replace(damping=0.16))
doubtful

# %% [markdown]
# A wrong law, a slow release or a neglected drag shows up in the same way.
#
# ## Next
#
# - Find the law that describes such runs: [Choosing a friction law](04_choosing_a_law.ipynb).
# - Fit many runs quickly: [Many runs at once](05_many_at_once.ipynb).
