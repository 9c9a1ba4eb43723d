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
# # From one free decay to friction coefficients
#
# A mass on a leaf spring is pulled aside, released, and slides to rest on a counterface while a laser interferometer
# watches it. This notebook takes one such run from the file to the coefficient of friction with its uncertainty.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj

# %% [markdown]
# ## The rig
#
# What is known about the machine, each number with its standard uncertainty. The normal force is known to 0.5 %,
# which will turn out to decide everything.

# %%
rig = fj.Rig(
    mass=fj.Measured(0.41068, 4e-5),  # kg
    stiffness=fj.Measured(2574.0, 2.0),  # N/m, a start value: the fit finds it from the frequency and the mass
    normal_force=fj.Measured(9.66, 0.0483),  # N
)
rig

# %% [markdown]
# ## The run
#
# No interferometer is at hand here, so a run is made up: dynamic friction 0.05, static friction 0.065, 1 nm of white
# noise, counts of 0.31 nm, a periodic nonlinearity of 2 nm, and a magnet whose force takes a millisecond to vanish.
# It is written to a file and read back like any other.

# %%
truth = fj.Oscillator(0.41068, 2574.0, 0.1756, 9.66, fj.friction.Coulomb(mu=0.05, mu_s=0.065))
made = fj.synthetic_run(
    truth,
    2e-3,
    rate=20_000.0,
    duration=0.3,
    hold=0.02,
    noise=1e-9,
    quantisation=0.309e-9,
    offset=3e-6,
    release_time_constant=1e-3,
    periodic_nonlinearity=(2e-9, 0.7e-9),
    seed=7,
)
folder = TemporaryDirectory()
path = Path(folder.name) / "run.csv"
fj.write(made, path)
record = fj.read(path)
record

# %% [markdown]
# ## A look before the fit
#
# Segmentation needs no model: it finds the release, the reversals and the rest in the samples alone.

# %%
print(fj.data.inspect(record).summary())

# %% [markdown]
# ## The fit
#
# Free are the dynamic coefficient, the viscous damping and the stiffness in contact. The motion before the first
# reversal is left out: there the magnet still pulls. Static friction has no gradient under Coulomb's law; naming it
# asks for the bracket between the last stop and the last reversal that was not one.

# %%
start = rig.oscillator(fj.friction.Coulomb(mu=0.1, mu_s=0.1))
fit = fj.fit(record, start, ["mu", "mu_s", "damping", "stiffness"], rig=rig)
fit

# %% [markdown]
# The scatter of the samples alone would give the coefficient to parts in ten million. The combined uncertainty says
# what it is worth: the 0.5 % of the normal force, and nothing else, limit it. The report also tells that the
# noise is larger than stated, and what the errors would be if it were not. What is more is the periodic nonlinearity
# of the interferometer, two nanometres in two millimetres.

# %%
figure = fit.plot()
figure

# %%
error = abs(fit.values["mu"] / 0.05 - 1)
relative = fit.combined_std_errors["mu"] / fit.values["mu"]
low, high = fit.intervals["mu_s"]
print(f"mu is {error:.1e} off; its combined relative uncertainty is {relative:.1e}")
print(f"static friction lies between {low:.4f} and {high:.4f}")
assert error < 1e-4
assert relative >= 0.005
assert low <= 0.065 < high

# %% [markdown]
# ## Including the release goes wrong
#
# The same fit from the release on, as if the magnet had let go at once, with the time of release free. The
# coefficient is off by thousands of its own standard errors, and the residuals say so.

# %%
naive = fj.fit(
    record,
    rig.oscillator(fj.friction.Coulomb(mu=0.1)),
    ["mu", "damping", "stiffness"],
    start="release",
    nuisance=["t_release", "x0", "offset"],
)
print(f"mu is {naive.values['mu'] / 0.05 - 1:.1e} off, residuals {naive.residual_rms * 1e9:.0f} nm rms")
print("\n".join(naive.warnings))
assert abs(naive.values["mu"] / 0.05 - 1) > 10 * error

# %% [markdown]
# ## What the model does elsewhere
#
# The fitted oscillator is a model like any other. Its final displacement against the initial one draws the sawtooth
# from which both coefficients can be read.

# %%
x0 = np.linspace(0.0, 2e-3, 9)
final = jax.vmap(lambda start: fj.final_displacement(fit.oscillator, start))(x0)
for start, end in zip(x0, final, strict=True):
    print(f"released from {start * 1e3:.2f} mm it stops at {end * 1e3:+.4f} mm")

# %%
folder.cleanup()
