"""Lengths of Fourier transforms are those of SciPy."""

import scipy.fft

from fricjax.numbers import fast_length


def test_lengths_are_those_of_scipy():
    lengths = [*range(1, 3000), 2**20 + 1, 10**6 + 3]
    assert [fast_length(n) for n in lengths] == [scipy.fft.next_fast_len(n, real=True) for n in lengths]
    below = [fast_length(n, at_most=True) for n in lengths]
    assert below == [scipy.fft.prev_fast_len(n, real=True) for n in lengths]
