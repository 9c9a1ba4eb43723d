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
# # A pendulum of one's own
#
# **I have a file from a student lab: angles of a pendulum, from a coarse encoder. What is the friction of its
# bearing?**
#
# Files of laboratories have preambles, semicolons, decimal commas and units of their own, encoders have steps, and
# zeros drift. This notebook goes from such a file to the friction, with each thing that can go wrong on the way and
# what is said about it.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)  # JAX computes in single precision unless it is told

import fricjax as fj

# %% [markdown]
# The next cell makes the file, and may be skipped: a pendulum with dry friction in its bearing, viscous damping, and
# air drag that goes with the square of the speed; an encoder of 1024 counts per turn, whose zero is 1.3° off and
# drifts.

# %%
truth = fj.Oscillator(
    mass=8.2e-3,  # of a pendulum the moment of inertia [kg m^2]
    stiffness=0.42,  # m g l [N m/rad]
    damping=2e-4,  # [N m s/rad]
    drag=1.5e-4,  # [N m s^2/rad^2]
    normal_force=0.05,  # load times radius of the journal [N m]
    friction=fj.friction.Coulomb(mu=0.12),
    restoring=fj.restoring.Pendulum(),
)
encoder = {"noise": np.radians(0.05), "quantisation": np.radians(360 / 1024)}
encoder |= {"offset": np.radians(1.3), "drift": np.radians(0.02)}
made = fj.synthetic_run(truth, np.radians(70.0), rate=200.0, duration=20.0, hold=1.0, seed=1, **encoder)
preamble = """Pendulum, student lab, bench 3
Operator;A. N.
Encoder;1024 counts per turn
Started;2026-03-02 14:05:11

Time (ms);Angle (deg);Encoder voltage (V)
"""
rows = (f"{1e3 * t:.0f};{x:.2f};{2.5 + x / 72:.3f}" for t, x in zip(made.t, np.degrees(made.x), strict=True))
folder = TemporaryDirectory()
path = Path(folder.name) / "bench3.csv"
path.write_text(preamble + "\n".join(rows).replace(".", ","))
print("\n".join(path.read_text().splitlines()[:9]))

# %% [markdown]
# ## Reading it
#
# Delimiter, decimal comma, preamble and units are found; of the two columns that could be meant the one with an angle
# is taken. `fj.read` without options is enough.

# %%
record = fj.read(path)
record.plot()

# %% [markdown]
# What a file leaves open is asked for, and what contradicts it is refused. Here are four ways to ask for the wrong
# thing, each with its answer:

# %%
for options in ({"column": "Angel"}, {"unit": "rad"}, {"column": "Encoder voltage"}, {"skip_rows": 7}):
    try:
        fj.read(path, **options)
    except fj.errors.DataError as error:
        print(f"{options}\n    {error}")

# %% [markdown]
# The voltage of the encoder tells the angle too, once its scale is given:

# %%
fj.read(path, column="Encoder voltage", unit="72 deg/V")

# %% [markdown]
# ## A look before the fit
#
# The table holds what the samples say by themselves: how regular the clock is, that the encoder has steps of 6 mrad,
# how many half-cycles there are, and where the pendulum stands at last.

# %%
fj.data.inspect(record)

# %% [markdown]
# ## First try: a linear spring
#
# The moment of inertia takes the place of the mass; it and the load are known, the rest is free. Where values of a
# law are free, those given are only the begin.


# %%
def pendulum(restoring):
    law = fj.friction.Coulomb(mu=0.1)
    return fj.Oscillator(8.2e-3, 0.42, 0.0, 0.05, law, restoring=restoring)


linear = fj.fit(record, pendulum(fj.restoring.Linear()), free=["mu", "damping", "stiffness"])
linear.plot()

# %%
print(linear.status)
print(*linear.warnings, sep="\n")

# %% [markdown]
# The fit misses the record, and says so in its status; the reversals tell which term is missing. A pendulum is no
# linear spring: from 70° its period is a tenth longer. The other warning is about the zero, which drifts.
#
# ## Second try: a pendulum, in air
#
# Drag that goes with the square of the speed is freed as well, for this pendulum swings through a quarter of a turn.

# %%
fit = fj.fit(record, pendulum(fj.restoring.Pendulum()), free=["mu", "damping", "drag", "stiffness"])
fit.plot()

# %%
fit

# %% [markdown]
# What is left is the staircase of the encoder, whose steps were recognised and count in the errors, and a drift of
# the zero, which counts as well. Both results beside the truth, which only a made-up file can tell:

# %%
true = 0.12
for name, each in (("linear", linear), ("pendulum", fit)):
    mu = fj.show.uncertain(each.values["mu"], each.std_errors["mu"])
    print(f"{name:<8} mu = {mu}, {100 * (each.values['mu'] / true - 1):+.1f} % off")

# %% [markdown]
# Try it without drag: the fit converges, mu comes out a seventh too low, and its error bar says 2 %. The residuals,
# 3.7 times as large as the noise, are what gives it away.
#
# The deceleration by friction in the second table needs no rig. Times the moment of inertia it is the torque of the
# bearing, and `propagate` carries the uncertainties of both along:

# %%
torque = fj.uncertainty.propagate(
    lambda inertia, deceleration: inertia * deceleration,
    {"inertia": fj.Measured(8.2e-3, 4e-5, "kg m^2"), "deceleration": fit.kinematics["friction_deceleration"]},
    quantity="friction torque",
    unit="N m",
)
print(torque.summary())

# %% [markdown]
# ## On the command line
#
# ```sh
# fricjax inspect bench3.csv --plot run.png
# fricjax fit bench3.csv --rig pendulum.toml --free mu,damping,drag,stiffness --plot fit.png --out fit.json
# ```
#
# ## Next
#
# - Several runs and other ways to read them: [Four routes](03_routes.ipynb).
# - A law that is not Coulomb's: [Choosing a friction law](04_choosing_a_law.ipynb).
# - A folder full of such files: [An archive](06_archive.ipynb).
