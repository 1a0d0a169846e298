"""Hysteresis operators: stick-slip slider, play and Bouc-Wen element."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.systems.hysteresis_operators import play_from, slider

Array = NDArray[np.float64]

#: Multiples of 1/8, whose sums and differences are exact.
paths = st.lists(st.integers(-200, 200), min_size=2, max_size=60).map(lambda all_: np.array(all_) / 8.0)
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


@given(paths, widths, st.integers(2, 5))
def test_slider_output_does_not_depend_on_oversampling(u: Array, breakaway: float, times: int) -> None:
    """Oversample the same path by a power of two."""
    factor = 2**times
    finer = np.interp(np.arange((u.size - 1) * factor + 1) / factor, np.arange(u.size), u)
    assert np.array_equal(apply_slider(finer, breakaway)[::factor], apply_slider(u, breakaway))


@given(paths, widths)
def test_slider_distance_is_below_the_breakaway(u: Array, breakaway: float) -> None:
    x = apply_slider(u, breakaway)
    assert (np.abs(u - x) < breakaway).all()
    assert np.array_equal((x - u[0]) / breakaway, np.round((x - u[0]) / breakaway))


@given(paths)
def test_slider_with_the_smallest_breakaway_follows_the_input(u: Array) -> None:
    assert np.array_equal(apply_slider(u, 0.125), u)


@given(paths, widths)
def test_play_stays_within_its_width_and_moves_only_at_its_edges(u: Array, width: float) -> None:
    x = play_from(u, width)
    assert x[0] == u[0]
    assert (np.abs(u - x) <= width).all()
    moving = np.flatnonzero(np.diff(x)) + 1
    assert np.array_equal(np.abs(u - x)[moving], np.full(moving.size, width))
