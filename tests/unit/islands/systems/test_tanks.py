"""Two tanks: what flows in is there or has flown out, what stands still balances, the rest flows over."""

from math import inf

import numpy as np
import pytest
import scipy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from islands.systems.tanks import cascade

Array = NDArray[np.float64]


def levels(
    u: Array,
    dt: float = 0.1,
    upper: tuple[float, float, float, float] = (1.0, 0.0, inf, 0.0),
    lower: tuple[float, float, float, float] = (1.0, 0.0, inf, 0.0),
    begin: tuple[float, float] = (0.0, 0.0),
    midway: Array | None = None,
) -> Array:
    """Return the lower tank's level; the input stays from sample to sample."""
    y = np.empty(u.size)
    between = np.stack([u, u]) if midway is None else midway
    cascade(np.ascontiguousarray(u), between, dt, upper, lower, *begin, y)
    return y


@given(st.lists(st.floats(0.0, 3.0), min_size=1, max_size=30), st.floats(0.0, 2.0), st.floats(0.0, 2.0))
def test_what_has_flown_in_is_in_the_lower_tank_in_the_end(pulses: list[float], x1: float, x2: float) -> None:
    """The upper one runs dry by a linear law, the lower one is closed."""
    u = np.concatenate([pulses, np.zeros(400)])
    y = levels(u, 0.1, (0.0, 1.0, inf, 0.0), (0.0, 0.0, inf, 0.0), (x1, x2))
    assert y[0] == x2
    assert y[-1] == pytest.approx(x1 + x2 + 0.1 * sum(pulses), rel=1e-12, abs=1e-12)


def test_what_goes_over_the_rim_and_is_caught_is_not_lost() -> None:
    u = np.concatenate([np.full(50, 2.0), np.zeros(600)])
    closed = (0.0, 0.0, inf, 0.0)
    total = 0.1 * u.sum()
    assert levels(u, upper=(0.0, 1.0, 0.4, 1.0), lower=closed)[-1] == pytest.approx(total, rel=1e-12)
    kept, half = (levels(u, upper=(0.0, 1.0, 0.4, part), lower=closed)[-1] for part in (0.0, 0.5))
    assert kept < 0.5 * total
    assert half == pytest.approx((kept + total) / 2, rel=1e-12)


@given(
    st.floats(0.2, 3.0), st.floats(0.5, 2.0), st.floats(0.5, 2.0), st.floats(0.0, 1.0), st.floats(0.0, 1.0)
)
def test_at_rest_as_much_flows_out_as_in(u: float, k1: float, k2: float, linear: float, own: float) -> None:
    y = levels(np.full(9000, u), 0.1, (k1, 0.0, inf, 0.0), (k2, linear, inf, own))[-1]
    assert k2 * np.sqrt(y) + linear * y == pytest.approx(u + own, rel=1e-6)


@pytest.mark.parametrize("caught", [0.0, 0.3, 1.0])
def test_at_the_rim_the_outflow_is_that_of_the_rim(caught: float) -> None:
    y = levels(np.full(10_000, 2.0), 0.005, (1.0, 0.0, 1.44, caught), (0.9, 0.0, inf, 0.0))[-1]
    # Half a step ahead the level is above the rim: an error of first order.
    through = 1.2 + caught * (2.0 - 1.2)
    assert y == pytest.approx((through / 0.9) ** 2, rel=0.003)


def test_the_lower_tank_stops_at_its_rim() -> None:
    u = 1.5 + np.sin(0.05 * np.arange(2000))
    free, stopped = (levels(u, lower=(1.0, 0.0, rim, 0.0)) for rim in (inf, 2.0))
    assert free.max() > 2.5
    assert stopped.max() == 2.0
    until = int(np.argmax(free > 2.0))
    assert np.array_equal(stopped[:until], free[:until])


@given(st.lists(st.floats(-5.0, 5.0), min_size=5, max_size=60))
def test_a_level_is_never_below_the_bottom(u: list[float]) -> None:
    y = levels(np.array(u), 0.5, (2.0, 0.3, 1.0, 0.5), (2.0, 0.1, 3.0, -0.5), (0.1, 0.2))
    assert (y >= 0.0).all()
    assert (y <= 3.0).all()


def test_half_the_step_has_a_quarter_of_the_error() -> None:
    def pumped(t):
        return 1.5 + np.sin(0.7 * t) + 0.4 * np.cos(2.1 * t)

    def slope(t, x):
        through = 0.8 * np.sqrt(x[0]) + 0.1 * x[0]
        return [pumped(t) - through, through + 0.2 - 0.9 * np.sqrt(x[1])]

    errors = []
    for dt in (0.2, 0.1):
        t = dt * np.arange(round(20 / dt) + 1)
        known = scipy.integrate.solve_ivp(slope, (0, 20), [1.0, 2.0], "DOP853", t, rtol=1e-10, atol=1e-12).y[
            1
        ]
        midway = np.stack([pumped(t + dt / 2), pumped(t + dt)])
        y = levels(pumped(t), dt, (0.8, 0.1, inf, 0.0), (0.9, 0.0, inf, 0.2), (1.0, 2.0), midway)
        errors.append(float(np.max(np.abs(y - known))))
    assert errors[0] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)
