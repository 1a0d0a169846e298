"""Elements that remember: a slider that sticks, play, and the Bouc-Wen element beside their own laws."""

from itertools import pairwise

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.systems.hysteresis_operators import bouc_wen, play_from, slider

Array = NDArray[np.float64]

#: Multiples of an eighth: sums and differences of them are exact.
paths = st.lists(st.integers(-200, 200), min_size=2, max_size=60).map(lambda all_: np.array(all_) / 8.0)
widths = st.integers(1, 40).map(lambda eighths: eighths / 8.0)


def slid(u: Array, breakaway: float) -> Array:
    x = np.empty(u.size)
    slider(np.ascontiguousarray(u), breakaway, x)
    return x


@given(paths, widths)
def test_a_slider_rests_until_it_breaks_away_and_joins_then(u: Array, breakaway: float) -> None:
    """The law itself, along a path that goes through every eighth between its samples."""
    at, known = u[0], [u[0]]
    for before, now in pairwise(u):
        for step in np.linspace(before, now, round(abs(now - before) * 8) + 1):
            if abs(step - at) >= breakaway:
                at = step
        known.append(at)
    assert np.array_equal(slid(u, breakaway), known)


@given(paths, widths, st.integers(2, 5))
def test_it_slips_between_samples_as_it_would_at_them(u: Array, breakaway: float, times: int) -> None:
    """Finer samples of the same path, a power of two as often, find it in the same places."""
    often = 2**times
    finer = np.interp(np.arange((u.size - 1) * often + 1) / often, np.arange(u.size), u)
    assert np.array_equal(slid(finer, breakaway)[::often], slid(u, breakaway))


@given(paths, widths)
def test_it_is_never_as_far_away_as_it_takes(u: Array, breakaway: float) -> None:
    x = slid(u, breakaway)
    assert (np.abs(u - x) < breakaway).all()
    assert np.array_equal((x - u[0]) / breakaway, np.round((x - u[0]) / breakaway))


@given(paths)
def test_one_that_breaks_away_at_once_stays_behind_by_nothing(u: Array) -> None:
    assert np.array_equal(slid(u, 0.125), u)


@given(paths, widths)
def test_play_is_within_its_width_and_moves_by_its_edges_alone(u: Array, width: float) -> None:
    x = play_from(u, width)
    assert x[0] == u[0]
    assert (np.abs(u - x) <= width).all()
    moved = np.flatnonzero(np.diff(x)) + 1
    assert np.array_equal(np.abs(u - x)[moved], np.full(moved.size, width))


def hysteresis(u: Array, dt: float, *values: float) -> Array:
    h = np.empty(u.size)
    bouc_wen(np.ascontiguousarray(u), dt, *values, h)
    return h


def test_a_bouc_wen_element_is_the_solution_of_its_equation() -> None:
    dt = 0.01
    t = dt * np.arange(600)
    u = 20 * np.sin(3 * t) + 5 * np.cos(7.3 * t)
    A, beta, gamma, leak, rate, asymmetry, h0 = 0.8, 0.04, -0.01, 0.5, 2e-3, 0.01, 1.5
    h, known = h0, []
    for k in range(t.size):
        known.append(h)
        if k + 1 < t.size:
            v = (u[k + 1] - u[k]) / dt
            faster = 1.0 + rate * abs(v)

            def slope(_s, h, v=v, faster=faster):
                return (
                    A * v
                    - beta * faster * abs(v) * h
                    - gamma * faster * v * np.abs(h)
                    - leak * h
                    - asymmetry * abs(v) * np.abs(h)
                )

            h = float(scipy.integrate.solve_ivp(slope, (0, dt), [h], rtol=1e-9, atol=1e-11).y[0, -1])
    found = hysteresis(u, dt, A, beta, gamma, leak, rate, asymmetry, h0)
    # Within a step in which h changes its sign the law has a kink.
    assert found == pytest.approx(np.array(known), abs=5e-4)
    assert np.max(np.abs(found)) > 5.0


@given(st.floats(0.2, 5.0))
def test_it_knows_no_time_but_for_its_leak_and_its_rate(faster: float) -> None:
    t = 0.01 * np.arange(300)
    u = 20 * np.sin(3 * t) + 5 * np.cos(7.3 * t)
    alone = (0.8, 0.04, -0.01, 0.0, 0.0, 0.01, 0.0)
    assert np.array_equal(hysteresis(u, 0.01, *alone), hysteresis(u, 0.01 / faster, *alone))
