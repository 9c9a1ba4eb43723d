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
# # An archive
#
# **I have a folder of runs, in several formats, some of them broken. What is the friction under each load?**
#
# `fj.batch` fits every file in a folder. It keeps one row per file in a table, also for files that it cannot fit. You
# can query the table with SQL, resume after an interruption, and share the results as one HTML page.

# %%
import os
from pathlib import Path
from tempfile import TemporaryDirectory

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)  # nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, figure

FAST = os.environ.get("FRICJAX_NOTEBOOKS") == "fast"  # the tests run fewer runs through the same steps

# %% [markdown]
# ## A folder
#
# The next cell makes the folder; you may skip it. There are three loads, each with runs in CSV, NPZ and HDF5. The
# names of the folders contain the load, as is common in laboratories. The coefficient falls a little with the load,
# and it scatters by half a percent from run to run.

# %%
temporary = TemporaryDirectory()
folder = Path(temporary.name) / "runs"
true = {4.0: 0.052, 8.0: 0.050, 12.0: 0.048}
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="8 +/- 0.5 % N", damping="0.1756(20) N s/m")
generator = np.random.default_rng(3)
for load, mu in true.items():
    (folder / f"load_{load:g}N").mkdir(parents=True)
    machine = rig.replace(normal_force=load)
    for number in range(4 if FAST else 20):
        law = fj.friction.Coulomb(mu * (1 + 0.005 * generator.standard_normal()))
        x0 = generator.uniform(2.2e-3, 2.6e-3)
        run = fj.synthetic_run(machine.oscillator(law), x0, rate=4000.0, duration=0.6, noise=5e-9, seed=number)
        fj.write(run, folder / f"load_{load:g}N" / f"run_{number:02d}.{('csv', 'npz', 'h5')[number % 3]}")

# %% [markdown]
# We add four bad files of the kind found in every archive: an empty file, a text that is not a run, a run that was
# stopped too early, and a run with mm in its header but numbers in micrometres.

# %%
(folder / "load_4N" / "run_90.csv").write_text("")
(folder / "load_8N" / "run_91.csv").write_text("Monday: magnet replaced, no run.\n")
fj.write(fj.Record(run.t[:150], run.x[:150]), folder / "load_8N" / "run_92.csv")
wrong = [f"{t:.6f},{1e6 * x:.4f}" for t, x in zip(run.t, run.x, strict=True)]
(folder / "load_12N" / "run_93.csv").write_text("\n".join(["time (s),x (mm)", *wrong]))
print(*sorted(str(path.relative_to(folder)) for path in folder.rglob("run_*")), sep="\n")

# %% [markdown]
# ## All files
#
# `facts` is a pattern that extracts values from the names of the files. The value `load` is the normal force of the
# run.

# %%
machine = rig.oscillator(fj.friction.Coulomb(0.04))
results = Path(temporary.name) / "results"
archive = fj.batch(folder, results, machine, rig=rig, facts=["load_{load}N/run_{number}.*"])
archive.plot("mu", against="load")

# %% [markdown]
# One run is a factor of a thousand above the others. We explain it below; first the table:

# %%
archive

# %% [markdown]
# Each rejected file has a sentence with the reason. A run that was fitted but looks odd has a warning.

# %%
whole = {"white-space": "normal", "text-align": "left"}  # show sentences in full
archive.failures()[["file", "outcome"]].style.set_properties(**whole)

# %%
archive.query("select file, warnings from runs where warnings <> ''").style.set_properties(**whole)

# %% [markdown]
# ## Queries
#
# `population` gives the mean for each load, its standard error including that of the rig, and the scatter from run to
# run. It sets the run in the wrong unit aside as an outlier.

# %%
populations = archive.population("mu", by="load")
for load, population in populations.items():
    print(f"{load:4g} N: {population}")

# %% [markdown]
# In SQL the table is called `runs`. You can query every column: values, uncertainties, residuals, facts from the
# names, the hash of the file, and versions.

# %%
archive.query("""
    select load, count(*) as runs, avg(mu) as mu, max(residual_rms) * 1e9 as worst_residual_nm
    from runs where status = 'ok' and warnings = '' group by load order by load
""")

# %%
loads = np.array(list(populations))
means = np.array([each.mean for each in populations.values()])
errors = np.array([each.std for each in populations.values()])
drawing, axes = figure()
axes[0, 0].errorbar(loads, means, 1.96 * errors, fmt="o", capsize=3, label="mean with its 95 % interval")
axes[0, 0].plot(list(true), list(true.values()), "x", markersize=8, label="true")
axes[0, 0].set(xlabel=axis_label("Normal force", "N"), ylabel="Coefficient of friction")
axes[0, 0].legend(loc="upper right", fontsize=8)
drawing

# %% [markdown]
# ## Resuming
#
# The same call resumes the work at any time: after an interruption, a full disk or a new file. It fits a file again
# only if the file or the settings have changed:

# %%
again = fj.batch(folder, results, machine, rig=rig, facts=["load_{load}N/run_{number}.*"])
print(again)

# %% [markdown]
# ## A page to share
#
# `fj.report.save` writes all runs, their pictures and the reasons of failure to one HTML file. The page needs no
# network:

# %%
page = fj.report.save(archive, Path(temporary.name) / "archive.html")
print(f"{page.name}, {page.stat().st_size / 1e6:.1f} MB")

# %% [markdown]
# ## On the command line
#
# ```sh
# fricjax batch runs --rig rig.toml --out results --facts "load_{load}N/run_{number}.*"
# fricjax status results
# fricjax query "select load, avg(mu), count(*) from runs where status = 'ok' group by load" results
# fricjax report results --out archive.html
# ```
#
# ## Next
#
# - Break down the uncertainty of such a mean: [Uncertainty budget](07_uncertainty_budget.ipynb).
# - Choose the release of the next run: [Sensitivity and design](08_sensitivity_and_design.ipynb).
