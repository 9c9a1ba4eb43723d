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
# A wrong model can fit a trace well. It is much less likely to get four different readings of the runs right: the
# whole trace, only where each run starts and ends, the triangles these pairs draw, and the energy that is lost. Where
# they disagree, the model does not hold.

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
# A dozen releases of one machine, from 1.1 mm to 2.6 mm, made up with 5 nm of noise. Static friction is a third
# larger than dynamic friction.

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
# On the right is what the second and third route look at. The farther the mass is pulled, the more half-cycles it
# makes, and where it ends runs up and down in triangles: a line per number of half-cycles. The lines are a dead band
# $x_d = \mu N/k$ wide and high, from which $\mu$ follows. They break off where static friction, larger than dynamic
# friction, holds the mass early: from these edges follows $\mu_s$.
#
# ## All at once

# %%
agreement = fj.compare_routes(runs, rig)
agreement

# %% [markdown]
# Four routes, one coefficient. The standard errors are those of the noise; that of the normal force, 0.5 %, is common
# to all of them and cannot make them differ. Each of them by itself:
#
# ## Route 1, the traces
#
# Runs of so few half-cycles hardly tell damping from friction, so the damping is that of the rig.

# %%
fj.fit_batch(runs, truth, free=["mu", "stiffness"])

# %% [markdown]
# ## Routes 2 and 3, where the runs begin and end
#
# `pairs_of` takes the first reversal for the begin, which a slow release cannot bias. The pairs also tell static
# friction: each stop says "at least", each reversal that was passed "at most".

# %%
pairs = fj.pairs_of(runs)
second = fj.fit_final_displacements(pairs.x0, pairs.xf, rig.oscillator(fj.friction.Coulomb(0.04)), free=["mu", "mu_s"])
second.plot()

# %%
third = fj.fit_triangle_map(pairs.x0, pairs.xf, rig, half_cycles=pairs.half_cycles)
low, high = second.intervals["mu_s"]
print(f"pairs:        mu = {fj.show.uncertain(second.values['mu'], second.std_errors['mu'])}")
print(f"triangle map: mu = {fj.show.uncertain(third.values['mu'], third.std_errors['mu'])}")
print(f"static friction lies between {low:.5f} and {high:.5f}, true 0.0665")

# %% [markdown]
# A dozen runs hold static friction to within a few percent. [Sensitivity and design](08_sensitivity_and_design.ipynb)
# shows how to choose releases so that three runs are enough.
#
# ## Route 4, the energy
#
# Potential and kinetic energy fall by the work of friction. Sample by sample that gives the friction force against
# velocity, without a law: the picture in which one would see a Stribeck curve.

# %%
force_map = fj.friction_force_map(runs, rig, bins=12)
force_map.plot()

# %% [markdown]
# ## When they disagree
#
# The same runs, evaluated with a damping that is a tenth too small, as if the rig had been calibrated in a draught.
# Each route puts the missing loss down to friction in its own way, and no two of them alike:

# %%
doubtful = fj.compare_routes(runs, rig.replace(damping=0.16))
doubtful

# %% [markdown]
# A wrong law, a slow release or a drag that was left out shows in the same way.
#
# ## Next
#
# - Which law does describe such runs: [Choosing a friction law](04_choosing_a_law.ipynb).
# - Many runs, quickly: [Many runs at once](05_many_at_once.ipynb).
