"""Linear filters, compared with those of SciPy bit for bit."""

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st

from islands.kernels.linear_filter import filter_linearly, low_pass_cubic

signals = st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=60).map(np.array)


@pytest.mark.parametrize(("zeros", "poles"), [(0, 0), (1, 0), (0, 1), (1, 1), (0, 3), (2, 2), (4, 4)])
@pytest.mark.parametrize("samples", [1, 2, 300])
def test_a_filter_has_the_bits_of_scipy(zeros, poles, samples):
    rng = np.random.default_rng(zeros + 10 * poles)
    b, a = rng.normal(size=1 + zeros), np.append(1.0, 0.3 * rng.normal(size=poles))
    x, state = rng.normal(size=samples), rng.normal(size=max(zeros, poles))
    given_state = state.copy()
    assert np.array_equal(filter_linearly(b, a, x), scipy.signal.lfilter(b, a, x))
    expected, _ = scipy.signal.lfilter(b, a, x, zi=state)
    assert np.array_equal(filter_linearly(b, a, x, state), expected)
    assert np.array_equal(state, given_state)


@given(signals, st.lists(st.floats(-2.0, 2.0), min_size=4, max_size=4).map(np.array), st.floats(0.0, 1.0))
def test_a_low_pass_filters_the_weighted_neighbours(x, weights, decay):
    seen = np.concatenate([[0.0], x - x[0], [x[-1] - x[0]]])
    moved = np.convolve(seen, weights[::-1], mode="valid")
    expected = np.append(x[0], scipy.signal.lfilter([1.0], [1.0, -decay], moved) + x[0])
    assert np.array_equal(low_pass_cubic(x, weights, decay), expected)
