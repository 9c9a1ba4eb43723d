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
# # A friction law of one's own
#
# **My contact follows none of the laws of the package. How do I fit my own?**
#
# A law is a class with its coefficients and one function: the force at a sliding speed. This notebook writes one in
# 15 lines, tests it against an independent solver, and fits it.

# %%
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.friction import AbstractSetValued, not_negative, positive, scalar
from fricjax.show import axis_label, figure

# %% [markdown]
# ## The law
#
# Where sliding is a matter of thermally activated hops, as in the models of Prandtl and Eyring, friction grows with
# the logarithm of the speed. Coulomb's law would be flat, Stribeck's falls:


# %%
class Activated(AbstractSetValued):
    """``F = mu N [1 + b asinh(v/v_0)]``: friction by thermal activation grows with the logarithm of the speed."""

    coefficients = {
        "mu": not_negative("", "coefficient of friction at rest"),
        "b": positive("", "growth of friction with the logarithm of the speed"),
        "v_0": positive("m/s", "speed from which on it grows"),
    }
    mu: float = eqx.field(converter=scalar)
    b: float = eqx.field(converter=scalar)
    v_0: float = eqx.field(converter=scalar)

    def sliding_force(self, speed, load):
        return self.mu * load * (1 + self.b * jnp.arcsinh(speed / self.v_0))


speed, load = np.geomspace(1e-4, 0.2, 200), np.float64(9.66)
own = Activated(mu=0.05, b=0.05, v_0=5e-3)
drawing, axes = figure()
for law, dashes in ((own, "-"), (fj.friction.Coulomb(0.05), "--"), (fj.friction.Stribeck(0.05, 0.06, 5e-3), ":")):
    axes[0, 0].semilogx(1e3 * speed, 1e3 * law.sliding_force(speed, load), dashes, label=type(law).__name__)
axes[0, 0].set(xlabel=axis_label("Speed", "mm/s"), ylabel=axis_label("Friction force", "mN"))
axes[0, 0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, fontsize=8)
drawing

# %% [markdown]
# What the class says is used: names and units stand in reports, `positive` keeps a fit from negative values, and a
# wrong value is refused with a sentence. `AbstractSetValued` says that the mass stays at rest as long as the spring
# pulls with less than the force at the begin of sliding; there are kinds for smooth laws and for laws with internal
# states.

# %%
try:
    Activated(mu=0.05, b=-0.05, v_0=5e-3)
except ValueError as error:
    print(error)

# %% [markdown]
# ## Is it right?
#
# The package integrates it by half-cycles in phase angle. The same motion by diffrax, from end to end in time, shares
# nothing with that but the class above:

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="9.66 +/- 0.5 % N", damping="0.1756(20) N s/m")
machine = rig.oscillator(own)
ts = np.linspace(0.0, 0.35, 701)
ours = fj.simulate(machine, 2.6e-3, ts)
reference = fj.simulate(machine, 2.6e-3, ts, engine="diffrax")

drawing, axes = figure(2, 1, share_x=True)
axes[0, 0].plot(ts, 1e3 * ours.x)
axes[0, 0].set_ylabel(axis_label("Displacement", "mm"))
axes[1, 0].plot(ts, 1e12 * (ours.x - reference.x))
axes[1, 0].set(xlabel=axis_label("Time", "s"), ylabel=axis_label("Difference from diffrax", "pm"))
drawing

# %% [markdown]
# ## A fit
#
# A law of one's own is fitted like any other: gradients, reversals, uncertainties and warnings included. It starts
# far away.

# %%
run = fj.synthetic_run(machine, 2.6e-3, rate=5000.0, duration=0.45, hold=0.02, noise=5e-9, seed=2)
start = rig.oscillator(Activated(mu=0.03, b=0.1, v_0=2e-2))
fit = fj.fit(run, start, free=["mu", "b", "v_0", "damping", "stiffness"], rig=rig)
fit.plot()

# %%
fit

# %%
for name, true in {"mu": 0.05, "b": 0.05, "v_0": 5e-3}.items():
    print(f"{name:<4} {fj.show.uncertain(fit.values[name], fit.std_errors[name], fit.units[name])}, true {true}")

# %% [markdown]
# And would one have noticed with Coulomb's law? `fj.compare` takes laws of one's own beside those of the package:
# `fj.compare(run, [machine, rig.oscillator(fj.friction.Coulomb(0.05))])`.
#
# To give a law to others, put it into `fricjax/friction/`, with the paper it comes from; CONTRIBUTING says which two
# tables it is then entered in, and all tests of laws run it against every oracle.
#
# ## Next
#
# - Which law describes the runs: [Choosing a friction law](04_choosing_a_law.ipynb).
# - Very many motions: [On a GPU](10_on_a_gpu.ipynb).
