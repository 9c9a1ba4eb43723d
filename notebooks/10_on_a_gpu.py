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
# For a single fit, no; for a hundred thousand motions, yes. This notebook measures the speed on the devices that it
# finds, even if there is only a CPU. It shows from which batch size a GPU is faster.

# %%
import os
import time

import jax
import jax.numpy as jnp
import numpy as np

jax.config.update("jax_enable_x64", True)  # also on a GPU: nanometres on millimetres need double precision

import fricjax as fj
from fricjax.show import axis_label, duration, figure

FAST = os.environ.get("FRICJAX_NOTEBOOKS") == "fast"  # the tests run smaller batches through the same steps

# %% [markdown]
# ## The devices
#
# JAX uses a GPU if there is one and if you have installed its support (`pip install 'jax[cuda13]'` for NVIDIA).
# Otherwise it computes on the CPU. The code in this notebook is the same in both cases.

# %%
devices = {device.platform: device for device in [*jax.devices("cpu"), *jax.devices()]}
for platform, device in devices.items():
    print(f"{platform}: {len(jax.devices(platform))} x {device.device_kind}")
if set(devices) == {"cpu"}:
    print("JAX has found no GPU. This notebook runs on the CPU.")

# %% [markdown]
# ## Batches of releases
#
# We compute the final displacements of a batch of releases in one compiled call, on each device. `jax.device_put`
# moves the releases to a device, and the computation follows its data. `with jax.default_device(device):` has the same
# effect for arrays that are created inside the block. JAX returns before the computation has finished, so we wait for
# the result before we read the clock.

# %%
rig = fj.Rig(mass="410.68(4) g", stiffness="2574(2) N/m", normal_force="9.66 +/- 0.5 % N", damping="0.1756(20) N s/m")
machine = rig.oscillator(fj.friction.Coulomb(mu=0.05, mu_s=0.06))


@jax.jit
@jax.vmap
def final(x0):
    return fj.final_displacement(machine, x0)


def seconds_for(function, x0):
    """Return the shortest time of three calls, after one that compiles."""
    function(x0).block_until_ready()
    times = []
    for _ in range(3):
        start = time.perf_counter()
        function(x0).block_until_ready()
        times.append(time.perf_counter() - start)
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
    print(f"{platform}: {duration(seconds[0])} for one release, {per_release} each in a batch of {sizes[best]}")

# %% [markdown]
# The time per release falls as long as the overhead of a call exceeds the computation. It is constant once the device
# is full. We compared an NVIDIA H100 with 16 CPU cores:
#
# | | H100 | 16 cores |
# |---|---|---|
# | one release | 133 us | 11 us |
# | each of 1000 releases | 0.1 us | 0.1 us |
# | each of 1,000,000 releases | 0.2 ns | 24 ns |
# | 20,000 traces of 400 samples | 0.4 ms | 53 ms |
#
# At a million releases the GPU was not yet full. Three things determine the gain from a GPU:
#
# - **Steps.** The host starts the steps of a loop one by one. Each step took about eight microseconds in our
#   measurements, for one motion or ten thousand. Engines with few steps therefore gain most: the closed form (Coulomb)
#   and half-cycles (Stribeck, your own laws). Integration in time needs ten thousand steps (LuGre); a GPU pays off
#   from about a thousand motions.
# - **Precision.** Double precision runs at 1/64 of the speed of single precision on GPUs for games, and at half the
#   speed on GPUs for computing.
# - **Memory.** 5000 samples of 100,000 motions take 4 GB. Compute only the quantities that you need: the final
#   displacement, the reversals, or every tenth sample.
#
# ## Whole motions
#
# We repeat the measurement for traces, in which the samples are the larger part of the work:

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
# The devices agree far below the noise of any instrument. Check this whenever you move a computation to another
# device:

# %%
on_each = [np.asarray(final(jax.device_put(np.linspace(0.1e-3, 3e-3, 1000), device))) for device in devices.values()]
largest = max(np.max(np.abs(each - on_each[0])) for each in on_each)
print(f"largest difference between devices: {largest:.1e} m")

# %% [markdown]
# ## Fits
#
# `fj.fit`, `fj.fit_batch`, `fj.compare` and bootstraps compute on the CPU, even if JAX has found a GPU. You need not
# set anything. They work on condensed records with a few hundred samples per run, and each step waits for the one
# before, so a GPU is slower. On the H100 a first fit took two to three times as long as on the 16 cores (LuGre: 42 s
# and 13 s). A later fit took two to four times as long, and a batch up to 35 times.
#
# For archives that take hours, use several processes: `fricjax batch runs --out results --workers 8`.
#
# ## Next
#
# - Map over coefficients and releases: [Many runs at once](05_many_at_once.ipynb).
# - Return to the beginning: [A first fit](01_first_fit.ipynb).
