"""Fits run with one BLAS thread and restore the user's limit."""

import numpy as np
import pytest
import threadpoolctl

import fricjax as fj

MACHINE = fj.Oscillator(0.4, 2500.0, 0.2, 10.0, fj.friction.Coulomb(0.05))
FREE = ["mu", "damping", "stiffness"]


def threads():
    """Return the largest number of threads of the loaded BLAS libraries."""
    return max(each["num_threads"] for each in threadpoolctl.threadpool_info() if each["user_api"] == "blas")


@pytest.mark.parametrize("runs", [1, 3])
def test_fits_have_one_thread_and_restore_the_limit(runs, monkeypatch):
    record = fj.synthetic_run(MACHINE, 2e-3, rate=2e3, duration=0.6, noise=1e-9, seed=0)
    work = (
        (lambda: fj.fit(record, MACHINE, FREE)) if runs == 1 else lambda: fj.fit_batch([record] * runs, MACHINE, FREE)
    )
    work()  # loads the BLAS of SciPy
    during = []
    inv = np.linalg.inv
    monkeypatch.setattr(np.linalg, "inv", lambda *args, **kwargs: during.append(threads()) or inv(*args, **kwargs))
    with threadpoolctl.threadpool_limits(2, "blas"):
        work()
        assert during and set(during) == {1}
        assert threads() == 2
