"""Operators with memory: stick-slip slider, play, rate limiter and uneven lag."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.kernels.memory_operators import lag_by_gap, lag_unevenly, limit_rate, play_from, slider

Array = NDArray[np.float64]

#: Multiples of 1/8, whose sums and differences are exact.
paths = st.lists(st.integers(-200, 200), min_size=2, max_size=60).map(lambda all_: np.array(all_) / 8.0)
reals = st.lists(st.floats(-20.0, 20.0), min_size=2, max_size=60).map(np.array)
steps = st.floats(0.05, 10.0)
widths = st.integers(1, 40).map(lambda eighths: eighths / 8.0)


def apply_slider(u: Array, breakaway: float) -> Array:
    x = np.empty(u.size)
    slider(np.ascontiguousarray(u), breakaway, x)
    return x


@given(paths, widths)
def test_slider_is_constant_until_breakaway_and_then_joins_the_input(u: Array, breakaway: float) -> None:
    """Compare with the definition, evaluated at every multiple of 1/8 between the samples."""
    at, known = u[0], [u[0]]
    for before, now in pairwise(u):
        for step in np.linspace(before, now, round(abs(now - before) * 8) + 1):
            if abs(step - at) >= breakaway:
                at = step
        known.append(at)
    assert np.array_equal(apply_slider(u, breakaway), known)


@given(paths, widths)
def test_play_stays_within_its_width_and_moves_only_at_its_edges(u: Array, width: float) -> None:
    x = play_from(u, width)
    assert x[0] == u[0]
    assert (np.abs(u - x) <= width).all()
    moving = np.flatnonzero(np.diff(x)) + 1
    assert np.array_equal(np.abs(u - x)[moving], np.full(moving.size, width))


@given(reals, steps)
def test_the_output_keeps_the_limit_and_the_range_of_the_input(u: Array, step: float) -> None:
    x = limit_rate(u, step)
    assert x[0] == u[0]
    assert np.abs(np.diff(x)).max() <= step * (1.0 + 1e-12) + 1e-12
    assert x.min() >= u.min() - 1e-9
    assert x.max() <= u.max() + 1e-9


@given(reals, steps, st.integers(2, 5))
def test_the_output_does_not_depend_on_oversampling(u: Array, step: float, factor: int) -> None:
    """The limiter acts between samples as well: the same path with more samples has the same output."""
    finer = np.interp(np.arange((u.size - 1) * factor + 1) / factor, np.arange(u.size), u)
    assert limit_rate(finer, step / factor)[::factor] == pytest.approx(limit_rate(u, step), abs=1e-9)


#: Time constants of a lag, from falling fast to rising fast.
lags = st.tuples(*[st.floats(0.0, 5.0)] * 4).map(np.array)


@given(reals, lags, st.floats(0.01, 5.0), st.integers(2, 5))
def test_an_uneven_lag_does_not_depend_on_oversampling(
    u: Array, times: Array, slow: float, factor: int
) -> None:
    finer = np.interp(np.arange((u.size - 1) * factor + 1) / factor, np.arange(u.size), u)
    found = lag_unevenly(finer, 1.0 / factor, slow, times)[::factor]
    assert found == pytest.approx(lag_unevenly(u, 1.0, slow, times), abs=1e-6)


def test_an_uneven_lag_approaches_a_step_with_the_time_constants_of_its_rate() -> None:
    """Upwards 2 s below a rate of 0.1 per second and 4 s above it, downwards 1 s."""
    times = np.array([1.0, 1.0, 2.0, 4.0])
    rise = lag_unevenly(np.concatenate([[0.0], np.ones(150)]), 0.1, 0.1, times)
    # The distance is 2 s * 0.1/s at the rate of 0.1/s, and grows by 4 s times what the rate is above that.
    rates, distances = np.diff(rise)[1:] / 0.1, 1.0 - 0.5 * (rise[1:-1] + rise[2:])
    expected = np.where(distances < 0.2, distances / 2.0, 0.1 + (distances - 0.2) / 4.0)
    assert rates == pytest.approx(expected, rel=3e-3)
    assert rates.max() > 0.2
    fall = lag_unevenly(np.concatenate([[1.0], np.zeros(80)]), 0.1, 0.1, times)
    assert fall[2:] / fall[1:-1] == pytest.approx(np.exp(-0.1))


@given(reals, st.floats(0.01, 5.0), st.floats(0.0, 5.0))
def test_a_growing_lag_keeps_its_largest_rate_and_the_range_of_the_input(
    u: Array, tau: float, inverse: float
) -> None:
    """A cubic through four samples exceeds their range by an eighth at both ends."""
    x = lag_by_gap(u, 1.0, tau, inverse)
    assert x[0] == u[0]
    assert x.min() >= u.min() - 0.125 * np.ptp(u) - 1e-6
    assert x.max() <= u.max() + 0.125 * np.ptp(u) + 1e-6
    assert np.abs(np.diff(x)).max() * inverse <= 1.0 + 1e-6
