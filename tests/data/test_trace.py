"""A trace keeps all digits, checks its arrays, supports jit and vmap."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from fricjax.data import Trace
from fricjax.data.record import listed
from fricjax.errors import DataError
from tests.tables import check_rows

T = [0.0, 0.1, 0.25, 0.3]


def test_lists_become_double_precision_numpy():
    trace = Trace(T, [1, 2, 3, 4], sigma=1e-9)
    assert isinstance(trace.t, np.ndarray) and trace.t.dtype == np.float64
    assert isinstance(trace.sigma, np.ndarray) and trace.sigma.shape == ()
    assert (trace.n, trace.n_used, trace.duration) == (4, 4, pytest.approx(0.3))


def test_precision_survives_without_x64():
    with jax.enable_x64(False):
        x = 2e-3 + 1e-12 * np.arange(4)
        assert np.array_equal(Trace(T, x).x, x)


def test_missing_samples_are_masked_and_held_at_zero():
    trace = Trace(T, [1.0, np.nan, np.inf, 4.0])
    assert trace.mask.tolist() == [True, False, False, True]
    assert trace.x.tolist() == [1.0, 0.0, 0.0, 4.0]
    both = Trace(T, [1.0, np.nan, 3.0, 4.0], mask=[True, True, False, True])
    assert both.mask.tolist() == [True, False, False, True]
    assert both.x[2] == 3.0


REFUSED = [
    (([[0.0, 1.0, 2.0]], [[1.0, 2.0, 3.0]]), r"t must be one-dimensional, but it has shape \(1, 3\)"),
    ((T, [1.0, 2.0, 3.0]), "t has 4 samples and x has 3"),
    (([0.0, 1.0], [1.0, 2.0]), "at least 3 samples, but only 2"),
    (([0.0, np.nan, 2.0], [1.0, 2.0, 3.0]), "t must be finite, but sample 1 is nan"),
    (([0.0, 2.0, 1.5], [1.0, 2.0, 3.0]), r"increase strictly, but sample 2 is 1.5 s after 2.0 s"),
    (([0.0, 1.0, 1.0], [1.0, 2.0, 3.0]), r"increase strictly, but sample 2 is 1.0 s after 1.0 s"),
    ((T, T, -1.0), "sigma must be positive and finite, but it is -1"),
    ((T, T, [1.0, 1.0, 0.0, 1.0]), r"it is 0 \(entry 2\)"),
    ((T, T, [1.0, 1.0]), "sigma must be one number or one per sample"),
    ((T, T, None, [1, 1, 0, 1]), "mask must be boolean"),
    ((T, T, None, [True]), "mask must have one entry per sample"),
    ((T, ["a", "b", "c", "d"]), "x must hold real numbers"),
]


def test_what_is_no_trace_is_refused_in_words():
    def check(arguments, message):
        with pytest.raises(DataError, match=message):
            Trace(*arguments)

    check_rows(check, REFUSED)


def test_a_trace_is_built_and_used_under_jit():
    @jax.jit
    def energy(t, x):
        trace = Trace(t, x)
        return jnp.sum(jnp.where(trace.mask, trace.x, 0.0) ** 2)

    x = jnp.array([1.0, jnp.nan, 2.0, 3.0])
    assert energy(jnp.array(T), x) == 14.0
    assert jax.grad(energy, argnums=1)(jnp.array(T), x).tolist() == [2.0, 0.0, 4.0, 6.0]


def test_traces_are_stacked_and_mapped():
    traces = [Trace(T, scale * np.ones(4)) for scale in (1.0, 2.0)]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *traces)
    assert stacked.n == 4
    assert jax.vmap(lambda trace: trace.x.sum())(stacked).tolist() == [4.0, 8.0]


def test_a_report_names_no_more_runs_than_fit_a_line():
    assert listed(["a.csv", "b.csv"]) == "a.csv, b.csv"
    assert listed([f"{i}.csv" for i in range(12)]) == "0.csv, 1.csv, 2.csv, 3.csv and 8 more"
    assert listed([""] * 5) == "run 0, run 1, run 2, run 3 and 1 more"
