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
# # Choosing a friction law
#
# **Is the friction of my contact Coulomb's, or something else? And would I notice?**
#
# We choose a law by the residuals that it leaves. This notebook examines two runs under several laws. In the first run
# friction falls as the mass moves faster. In the second the contact bends before it slides.

# %%
import jax
import numpy as np

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, figure

# %% [markdown]
# ## The laws
#
# The plot shows the friction force against speed for four of the laws in the package (`fricjax models` lists all of
# them):

# %%
load = 9.66  # N
laws = {
    "Coulomb": fj.friction.Coulomb(mu=0.05),
    "Stribeck": fj.friction.Stribeck(mu=0.05, mu_s=0.06, v_stribeck=10e-3),
    "Coulomb + viscous": fj.friction.Coulomb(mu=0.05) + fj.friction.Viscous(1.0),
    "Tanh": fj.friction.Tanh(mu=0.05, v_s=5e-3),
}
speed = np.linspace(0.0, 0.05, 400)
drawing, axes = figure()
for (name, law), dashes in zip(laws.items(), ("-", "--", ":", "-."), strict=True):
    axes[0, 0].plot(1e3 * speed, 1e3 * np.asarray(law.sliding_force(speed, np.float64(load))), dashes, label=name)
axes[0, 0].set(xlabel=axis_label("Speed", "mm/s"), ylabel=axis_label("Friction force", "mN"))
axes[0, 0].legend(loc="lower right", fontsize=8)
drawing

# %% [markdown]
# ## First contact: friction that falls with speed
#
# We simulate a run with the dashed curve and fit two laws to it. Only the residuals distinguish them:

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="9.66 +/- 0.5 % N", damping="0.1756(20) N s/m")
made = {"rate": 5000.0, "duration": 0.45, "noise": 5e-9, "seed": 4}
run = fj.synthetic_run(rig.oscillator(laws["Stribeck"]), 2.6e-3, **made)

candidates = [
    rig.oscillator(fj.friction.Coulomb(0.04)),
    rig.oscillator(fj.friction.Stribeck(0.04, mu_s=0.05, v_stribeck=5e-3)),
]
free = [["mu", "damping", "stiffness"], ["mu", "mu_s", "v_stribeck", "damping", "stiffness"]]
comparison = fj.compare(run, candidates, free, held_out=False)
comparison.plot()

# %% [markdown]
# The residuals of Coulomb's law follow the oscillation. Those of Stribeck's law are only noise. The table gives the
# numbers:

# %%
comparison

# %% [markdown]
# BIC weighs the quality of the fit against the number of coefficients. A difference of ten from the smallest BIC is
# decisive. The fingerprints below the table need no law. Here the half-cycles lose more at small amplitudes, at which
# the mass is slow.

# %%
best = comparison.best
for name, true in {"mu": 0.05, "mu_s": 0.06, "v_stribeck": 10e-3}.items():
    print(f"{name:<10} {fj.show.uncertain(best.values[name], best.std_errors[name], best.units[name])}, true {true}")

# %% [markdown]
# ## Second contact: it bends before it slides
#
# The LuGre law describes the contact as a brush of stiff bristles. They hardly affect the sliding mass. After the
# stop, however, the mass rings on the bristles, with an amplitude far too small to see in the full trace:

# %%
bristles = fj.friction.LuGre(mu=0.05, mu_s=0.06, v_stribeck=10e-3, sigma0=2e5, sigma1=60.0)
ringing = fj.synthetic_run(rig.oscillator(bristles), 2.6e-3, **made)
stop = ringing.segmentation.rest
after = (ringing.t > stop - 2e-3) & (ringing.t < stop + 30e-3)
drawing, axes = figure(1, 2)
axes[0, 0].plot(ringing.t, 1e3 * ringing.x)
axes[0, 0].set(xlabel=axis_label("Time", "s"), ylabel=axis_label("Displacement", "mm"))
at_rest = ringing.segmentation.rest_position
axes[0, 1].plot(1e3 * (ringing.t[after] - stop), 1e6 * (ringing.x[after] - at_rest))
axes[0, 1].set(xlabel=axis_label("Time after the stop", "ms"), ylabel=axis_label("Displacement", "um"))
drawing

# %%
bristle = rig.oscillator(fj.friction.LuGre(mu=0.04, mu_s=0.05, v_stribeck=5e-3, sigma0=1e5, sigma1=100.0))
second = fj.compare(
    ringing,
    [candidates[1], bristle],
    [free[1], ["mu", "mu_s", "v_stribeck", "sigma0", "sigma1", "damping", "stiffness"]],
    held_out=False,
)
second.plot()

# %%
second

# %% [markdown]
# The ringing reveals the bristles: its frequency gives their stiffness, and its decay gives their damping.
#
# Three rules help to choose a law:
#
# 1. Take the law with the smallest BIC, but only if its residual tests pass. The best of several laws can still be
#    wrong.
# 2. Do not free coefficients that no run can determine. [Sensitivity and design](08_sensitivity_and_design.ipynb)
#    finds them before the measurement.
# 3. If two laws are equally good, give the result of the simpler one, and say so.
#
# ## On the command line
#
# ```sh
# fricjax compare run.csv --rig rig.toml --friction coulomb --friction stribeck --friction lugre --plot laws.png
# ```
#
# ## Next
#
# - Fit many runs in one call: [Many runs at once](05_many_at_once.ipynb).
# - Write a law that is not in the package: [Your own friction law](09_own_law.ipynb).
