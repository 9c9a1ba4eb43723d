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
# # Your own friction law
#
# **My contact does not follow any law of the package. How do I fit my own?**
#
# A law is a class with coefficients and one method: the force at a sliding speed. In this notebook we write a law in
# 15 lines, test it against an independent solver, and fit it.

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
# In models of thermally activated sliding, such as those of Prandtl and Eyring, friction grows with the logarithm of
# the speed. For comparison we plot Coulomb's law, which is constant, and Stribeck's law, which falls:


# %%
class Activated(AbstractSetValued):
    """Thermally activated friction, ``F = mu N [1 + b asinh(v/v_0)]``."""

    coefficients = {
        "mu": not_negative("", "coefficient of friction at rest"),
        "b": positive("", "growth of friction with the logarithm of the speed"),
        "v_0": positive("m/s", "speed above which friction grows"),
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
# The package uses the definitions of the class. Names and units appear in reports, `positive` keeps a fit from
# negative values, and a wrong value raises an error that explains it. The base class `AbstractSetValued` means that
# the mass stays at rest while the spring pulls with less than the force at the beginning of sliding. There are other
# base classes for smooth laws and for laws with internal states.

# %%
try:
    Activated(mu=0.05, b=-0.05, v_0=5e-3)
except ValueError as error:
    print(error)

# %% [markdown]
# ## A test against another solver
#
# The package integrates the motion by half-cycles in phase angle. diffrax integrates it in time, from beginning to
# end. The two computations share only the class above:

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
# You fit your own law like any other; gradients, reversals, uncertainties and warnings are included. We start the fit
# far from the true values.

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
# Would we have noticed an error with Coulomb's law? `fj.compare` accepts your own laws together with those of the
# package: `fj.compare(run, [machine, rig.oscillator(fj.friction.Coulomb(0.05))])`.
#
# To contribute a law, put it into `fricjax/friction/` and cite the paper it comes from. CONTRIBUTING names the two
# tables to which you add it. All tests of laws then run it against every oracle.
#
# ## Next
#
# - Find the law that describes your runs: [Choosing a friction law](04_choosing_a_law.ipynb).
# - Simulate very many motions: [On a GPU](10_on_a_gpu.ipynb).
