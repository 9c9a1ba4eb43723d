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
# # Your own pendulum
#
# **I have a file from a student lab: angles of a pendulum, from a coarse encoder. What is the friction of its
# bearing?**
#
# Laboratory files have preambles, semicolons, decimal commas and unusual units. Encoders have a finite resolution, and
# their zeros drift. In this notebook we go from such a file to the friction of the bearing. On the way we make the
# usual mistakes and read the messages that explain them.

# %%
from pathlib import Path
from tempfile import TemporaryDirectory

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)  # the default of JAX is single precision

import fricjax as fj

# %% [markdown]
# The next cell makes the file; you may skip it. It simulates a pendulum with dry friction in its bearing, viscous
# damping, and air drag that grows with the square of the speed. The encoder has 1024 counts per turn. Its zero is 1.3°
# off and drifts.

# %%
truth = fj.Oscillator(
    mass=8.2e-3,  # moment of inertia of the pendulum [kg m^2]
    stiffness=0.42,  # m g l [N m/rad]
    damping=2e-4,  # [N m s/rad]
    drag=1.5e-4,  # [N m s^2/rad^2]
    normal_force=0.05,  # load times journal radius [N m]
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
# ## Reading the file
#
# `fj.read` needs no options here. It detects the delimiter, the decimal comma, the preamble and the units. Two columns
# could contain the motion; it chooses the one with an angle.

# %%
record = fj.read(path)
record.plot()

# %% [markdown]
# If the file leaves something open, the error message names the option to pass. If an option contradicts the file,
# `fj.read` refuses it. Here are four wrong calls, each with its message:

# %%
for options in ({"column": "Angel"}, {"unit": "rad"}, {"column": "Encoder voltage"}, {"skip_rows": 7}):
    try:
        fj.read(path, **options)
    except fj.errors.DataError as error:
        print(f"{options}\n    {error}")

# %% [markdown]
# The voltage of the encoder also gives the angle, once we pass its scale:

# %%
fj.read(path, column="Encoder voltage", unit="72 deg/V")

# %% [markdown]
# ## A look before the fit
#
# The table summarises the samples without a model: the regularity of the clock, the encoder steps of 6 mrad, the
# number of half-cycles, and the final position of the pendulum.

# %%
fj.data.inspect(record)

# %% [markdown]
# ## First try: a linear spring
#
# The moment of inertia plays the role of the mass. We know it and the load, and free the other parameters. The values
# of the free parameters are only start values.


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
# The fit does not describe the record, and its status says so. It names two missing terms, which fricjax has tried: a
# spring that softens, and drag. A pendulum is such a spring: released at 70°, its period is a tenth longer.
#
# ## Second try: a pendulum in air
#
# This pendulum swings fast, through more than a quarter of a turn. We therefore also free the drag, which grows with
# the square of the speed.

# %%
fit = fj.fit(record, pendulum(fj.restoring.Pendulum()), free=["mu", "damping", "drag", "stiffness"])
fit.plot()

# %%
fit

# %% [markdown]
# The residuals now show only the staircase of the encoder and the drift of its zero. The fit recognises both, and its
# standard errors include them. Because we made the file, we can compare both fits with the truth:

# %%
true = 0.12
for name, each in (("linear", linear), ("pendulum", fit)):
    mu = fj.show.uncertain(each.values["mu"], each.std_errors["mu"])
    print(f"{name:<8} mu = {mu}, error {100 * (each.values['mu'] / true - 1):+.1f} %")

# %% [markdown]
# Try the fit without drag. Its status names the drag, and mu comes out a fifth too low.
#
# The second table contains the deceleration by friction, which needs no rig. Its product with the moment of inertia is
# the friction torque of the bearing. `propagate` combines the uncertainties of both:

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
# - Evaluate several runs in different ways: [Four routes](03_routes.ipynb).
# - Fit a law other than Coulomb's: [Choosing a friction law](04_choosing_a_law.ipynb).
# - Fit a folder full of such files: [An archive](06_archive.ipynb).
