"""Envelopes keep every peak of a signal."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from islands.records.envelope import find_envelope

SIGNALS = arrays(
    float, st.integers(1, 50), elements=st.floats(-1e9, 1e9) | st.just(float("nan")), fill=st.nothing()
)


@given(SIGNALS, st.integers(1, 60))
def test_parts_cover_the_signal_and_hold_its_extremes(values, points):
    least, greatest, first = find_envelope(values, points)
    assert first.size == min(points, values.size)
    for low, high, part in zip(least, greatest, np.split(values, first[1:]), strict=True):
        known = part[~np.isnan(part)]
        assert part.size in (values.size // first.size, values.size // first.size + 1)
        if known.size:
            assert (low, high) == (known.min(), known.max())
        else:
            assert np.isnan(low)
            assert np.isnan(high)


def test_a_short_signal_is_its_own_envelope():
    values = np.array([3.0, 1.0, 2.0])
    for each in find_envelope(values, 10)[:2]:
        np.testing.assert_array_equal(each, values)


@pytest.mark.parametrize("points", [1, 7])
def test_no_samples_have_no_parts(points):
    assert [each.size for each in find_envelope(np.empty(0), points)] == [0, 0, 0]
