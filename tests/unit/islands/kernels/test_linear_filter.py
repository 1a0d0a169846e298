"""Linear filters, compared with those of SciPy bit for bit."""

import numpy as np
import pytest
import scipy

from islands.kernels.linear_filter import divide_rows, filter_linearly


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


@pytest.mark.parametrize("series", [1, 3, 4, 6])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_every_segment_of_every_series_is_divided_from_rest(series, order):
    rng = np.random.default_rng(series + 10 * order)
    a, x, ends = (
        np.poly(rng.uniform(-0.9, 0.9, order))[1:],
        rng.normal(size=(series, 300)),
        np.array([2, 120, 300]),
    )
    divided = divide_rows(a, x, ends)
    for first, last in zip([0, *ends[:-1]], ends, strict=True):
        expected = scipy.signal.lfilter([1.0], np.append(1.0, a), x[:, first:last])
        np.testing.assert_allclose(divided[:, first:last], expected, rtol=0, atol=1e-13)


def test_bits_of_a_divided_series_do_not_depend_on_the_others():
    rng = np.random.default_rng(0)
    a, x, ends = np.array([-1.5, 0.7]), rng.normal(size=(7, 200)), np.array([80, 200])
    alone = [divide_rows(a, x[row : row + 1], ends)[0] for row in range(7)]
    assert np.array_equal(divide_rows(a, x, ends), alone)
