# ---
# jupyter:
#   jupytext:
#     formats: ipynb,py:percent
#     text_representation:
#       extension: .py
#       format_name: percent
#       format_version: '1.3'
#       jupytext_version: 1.19.6
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # On a GPU
#
# **I have a GPU. Will it make this faster?**
#
# For a single fit no; for a hundred thousand motions yes. This notebook measures it on whatever it finds, also where
# that is only a processor, and shows from which number on it pays.

# %%
import os
import time

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)  # also on a GPU: nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, duration, figure

FAST = os.environ.get("FRICJAX_NOTEBOOKS") == "fast"  # the tests run every notebook: smaller batches, the same steps

# %% [markdown]
# ## What is there
#
# JAX takes a GPU where it finds one and is installed for it (`pip install 'jax[cuda13]'` for those of NVIDIA);
# otherwise it computes on the processor. Nothing in this notebook changes with that.

# %%
devices = {device.platform: device for device in [*jax.devices("cpu"), *jax.devices()]}
for platform, device in devices.items():
    print(f"{platform}: {device.device_kind}, {len(jax.devices(platform))} of them")
if set(devices) == {"cpu"}:
    print("There is no GPU here, or JAX does not know of it. All that follows runs on the processor.")

# %% [markdown]
# ## How many at once
#
# Final displacements of a batch of releases, all in one compiled call, on each device. `jax.device_put` moves the
# releases there, and the computation follows its data; `with jax.default_device(device):` does the same for arrays
# that are made within. JAX returns before it has computed, so one waits for the result before one reads the clock.

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="9.66 +/- 0.5 % N", damping="0.1756(20) N s/m")
machine = rig.oscillator(fj.friction.Coulomb(mu=0.05, mu_s=0.06))


@jax.jit
@jax.vmap
def final(x0):
    return fj.final_displacement(machine, x0)


def seconds_for(function, x0):
    """Shortest of three calls, the one that compiles left out."""
    function(x0).block_until_ready()
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        function(x0).block_until_ready()
        times.append(time.perf_counter() - begin)
    return min(times)


sizes = [1, 10, 100, 1000, 10_000] if FAST else [1, 10, 100, 1000, 10_000, 100_000, 1_000_000]
taken = {
    platform: [seconds_for(final, jax.device_put(np.linspace(0.1e-3, 3e-3, size), device)) for size in sizes]
    for platform, device in devices.items()
}
drawing, axes = figure()
for (platform, seconds), marker in zip(taken.items(), "os", strict=False):
    axes[0, 0].loglog(sizes, 1e6 * np.array(seconds) / sizes, marker=marker, label=platform)
axes[0, 0].set(xlabel="Releases in a batch", ylabel=axis_label("Time per release", "us"))
axes[0, 0].legend(loc="upper right", fontsize=8)
drawing

# %%
for platform, seconds in taken.items():
    best = int(np.argmin(np.array(seconds) / sizes))
    per_release = duration(seconds[best] / sizes[best])
    print(f"{platform}: one in {duration(seconds[0])}, {sizes[best]} at once in {per_release} each")

# %% [markdown]
# The curve falls as long as a call costs more than what it computes, and is flat where the device is full. On
# an NVIDIA H100 beside 16 cores one release took 133 us, and 11 us on the cores; a thousand at once took 0.1 us each on
# either; a million took 0.2 ns each on the GPU, which still had room, and 24 ns on the cores. Traces gain more:
# 20,000 of 400 samples took 0.4 ms, and 53 ms on the cores.
#
# Three things decide what a GPU gives. The steps of a loop are started one by one from the host, some eight
# microseconds each where we looked, whether for one motion or for ten thousand: engines with few steps gain most, the
# closed form (Coulomb) and half-cycles (Stribeck, laws of one's own), and integration in time with ten thousand steps
# (LuGre) pays from about a thousand motions on. Double precision is a sixty-fourth as fast as single on GPUs for
# games, and half as fast on those for computing. And samples take memory: 5000 of them for 100,000 motions are 4 GB,
# so ask for what is needed, the final displacement, the reversals, or every tenth sample.
#
# ## Whole motions
#
# The same for traces, whose samples are the larger part of the work:

# %%
ts = jnp.linspace(0.0, 0.4, 400)
traces = jax.jit(jax.vmap(lambda x0: fj.simulate(machine, x0, ts).x))
count = 200 if FAST else 20_000
for platform, device in devices.items():
    x0 = jax.device_put(np.linspace(1e-3, 3e-3, count), device)
    seconds = seconds_for(traces, x0)
    x = traces(x0)
    print(
        f"{platform}: {count} motions of {ts.size} samples in {duration(seconds)}, {x.nbytes / 1e6:.1f} MB, {x.dtype}"
    )

# %% [markdown]
# The devices agree to far below the noise of any instrument, which is worth a look whenever a computation moves:

# %%
on_each = [np.asarray(final(jax.device_put(np.linspace(0.1e-3, 3e-3, 1000), device))) for device in devices.values()]
largest = max(np.max(np.abs(each - on_each[0])) for each in on_each)
print(f"largest difference between devices: {largest:.1e} m")

# %% [markdown]
# ## Fits
#
# `fj.fit`, `fj.fit_batch`, `fj.compare` and bootstraps compute on the processor, also where JAX has found a GPU, so
# there is nothing to set. They work on condensed records, some hundred samples for each run, in steps that wait for
# each other: on the H100 a first fit took two to three times as long as on the cores beside it (LuGre 42 s, and 13 s),
# a fit after it two to four times, and a batch up to 35 times.
#
# For archives that take hours there are several processes: `fricjax batch runs --out results --workers 8`.
#
# ## Next
#
# - Maps over coefficients and releases: [Many runs at once](05_many_at_once.ipynb).
# - Back to the begin: [A first fit](01_first_fit.ipynb).
