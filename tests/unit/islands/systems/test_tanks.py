"""Cascaded tanks: conservation of volume, steady states, overflow and order of the integrator."""

from math import inf

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.systems.tanks import cascade

Array = NDArray[np.float64]


def simulate(
    u: Array,
    dt: float = 0.1,
    upper: tuple[float, float, float, float] = (1.0, 0.0, inf, 0.0),
    lower: tuple[float, float, float, float] = (1.0, 0.0, inf, 0.0),
    initial_levels: tuple[float, float] = (0.0, 0.0),
    intersample: Array | None = None,
) -> Array:
    """Return the level of the lower tank; the input is constant between samples by default."""
    y = np.empty(u.size)
    values = np.stack([u, u]) if intersample is None else intersample
    cascade(np.ascontiguousarray(u), values, dt, upper, lower, *initial_levels, y)
    return y


@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=30), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_total_inflow_ends_in_the_closed_lower_tank(pulses: list[float], x1: float, x2: float) -> None:
    """The upper tank empties with a linear outflow; the lower tank has no outflow."""
    u = np.concatenate([pulses, np.zeros(400)])
    y = simulate(u, 0.1, (0.0, 1.0, inf, 0.0), (0.0, 0.0, inf, 0.0), (x1, x2))
    assert y[0] == x2
    assert y[-1] == pytest.approx(x1 + x2 + 0.1 * sum(pulses), rel=1e-12, abs=1e-12)


def test_caught_overflow_is_not_lost() -> None:
    u = np.concatenate([np.full(50, 2.0), np.zeros(600)])
    closed = (0.0, 0.0, inf, 0.0)
    total = 0.1 * u.sum()
    assert simulate(u, upper=(0.0, 1.0, 0.4, 1.0), lower=closed)[-1] == pytest.approx(total, rel=1e-12)
    lost, half = (simulate(u, upper=(0.0, 1.0, 0.4, part), lower=closed)[-1] for part in (0.0, 0.5))
    assert lost < 0.5 * total
    assert half == pytest.approx((lost + total) / 2, rel=1e-12)


@given(
    # From 0.4 on, one step of 0.1 s does not empty a tank, which would be a cycle in place of a steady state.
    st.floats(0.45, 3.0),
    st.floats(0.5, 2.0),
    st.floats(0.5, 2.0),
    st.floats(0.0, 1.0),
    st.floats(0.0, 1.0),
)
def test_outflow_equals_inflow_in_the_steady_state(
    u: float, k1: float, k2: float, linear: float, own: float
) -> None:
    y = simulate(np.full(9000, u), 0.1, (k1, 0.0, inf, 0.0), (k2, linear, inf, own))[-1]
    assert k2 * np.sqrt(y) + linear * y == pytest.approx(u + own, rel=1e-6)


@pytest.mark.parametrize("caught", [0.0, 0.3, 1.0])
def test_outflow_of_an_overflowing_tank_is_that_at_its_overflow_level(caught: float) -> None:
    y = simulate(np.full(10_000, 2.0), 0.005, (1.0, 0.0, 1.44, caught), (0.9, 0.0, inf, 0.0))[-1]
    # At half a step the level exceeds the overflow level, which gives a first-order error.
    through = 1.2 + caught * (2.0 - 1.2)
    assert y == pytest.approx((through / 0.9) ** 2, rel=0.003)


def test_lower_tank_does_not_exceed_its_overflow_level() -> None:
    u = 1.5 + np.sin(0.05 * np.arange(2000))
    unlimited, limited = (simulate(u, lower=(1.0, 0.0, rim, 0.0)) for rim in (inf, 2.0))
    assert unlimited.max() > 2.5
    assert limited.max() == 2.0
    first = int(np.argmax(unlimited > 2.0))
    assert np.array_equal(limited[:first], unlimited[:first])


@given(st.lists(st.floats(-5.0, 5.0), min_size=5, max_size=60))
def test_levels_are_never_negative(u: list[float]) -> None:
    y = simulate(np.array(u), 0.5, (2.0, 0.3, 1.0, 0.5), (2.0, 0.1, 3.0, -0.5), (0.1, 0.2))
    assert (y >= 0.0).all()
    assert (y <= 3.0).all()


def test_halving_the_step_divides_the_tank_error_by_four() -> None:
    def pump(t):
        return 1.5 + np.sin(0.7 * t) + 0.4 * np.cos(2.1 * t)

    def slope(t, x):
        through = 0.8 * np.sqrt(x[0]) + 0.1 * x[0]
        return [pump(t) - through, through + 0.2 - 0.9 * np.sqrt(x[1])]

    errors = []
    for dt in (0.2, 0.1):
        t = dt * np.arange(round(20 / dt) + 1)
        known = scipy.integrate.solve_ivp(slope, (0, 20), [1.0, 2.0], "DOP853", t, rtol=1e-10, atol=1e-12).y[
            1
        ]
        intersample = np.stack([pump(t + dt / 2), pump(t + dt)])
        y = simulate(pump(t), dt, (0.8, 0.1, inf, 0.0), (0.9, 0.0, inf, 0.2), (1.0, 2.0), intersample)
        errors.append(float(np.max(np.abs(y - known))))
    assert errors[0] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)
