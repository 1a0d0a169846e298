"""Products of the derivatives of a state space: those of its differences, in one lane or several."""

import numpy as np
import pytest

from islands.kernels.state_space import BELL, TANH, simulate_state_space, trace_states
from islands.kernels.state_space_products import NO_DERIVATIVES, accumulate_products
from islands.models.unit_functions import find_codes
from islands.simulation.initial_states import Segment
from islands.simulation.segment_lanes import SegmentLanes

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

ALL_UNITS = (*range(TANH, BELL + 1), *find_codes(["tanh(square)", "s*abs", "bell*s*tanh(s*cube)"]).tolist())
INPUTS, ROWS = 2, 300

#: Limits of a sensor that has none.
LIMITS = (-np.inf, np.inf)


def make_system(codes, seed=0, order=3):
    """Return stable parameters, inputs and initial states."""
    rng = np.random.default_rng(seed)
    units = len(codes)
    sizes = [order * INPUTS, order, INPUTS, order * units, units, units * (order + INPUTS), units, order, 1]
    a = np.diag(rng.uniform(0.3, 0.8, order)) + 0.05 * rng.standard_normal((order, order))
    theta = np.concatenate([a.ravel(), *(0.2 * rng.standard_normal(size) for size in sizes)])
    return theta, rng.standard_normal((ROWS, INPUTS)), rng.standard_normal(order)


def simulate(theta, codes, u, x):
    y = np.empty(len(u))
    assert simulate_state_space(theta, codes, u, x.copy(), y) == len(u)
    return y


def accumulate(theta, places, codes, u, x, y, limits=LIMITS, derivatives=NO_DERIVATIVES):
    """Return the products of a free run."""
    traces = np.empty((len(u), x.size + 2 * len(codes), 1))
    assert trace_states(theta, codes, u, x, traces) == len(u)
    columns = places.max() + 1
    products = np.empty((columns + x.size + 1,) * 2)
    accumulate_products(theta, places, len(codes), traces, 0, u, y, *limits, columns, products, derivatives)
    return products


@pytest.mark.parametrize("order", [1, 2, 3, 6])
@pytest.mark.parametrize("code", ALL_UNITS)
def test_the_products_are_those_of_the_derivatives_and_the_error(code, order):
    codes = np.array([TANH, code])
    theta, u, x = make_system(codes, code % 1000, order)
    y = simulate(theta, codes, u, x) + 0.1 * np.random.default_rng(9).standard_normal(ROWS)
    y[[0, 7, ROWS - 1]] = np.nan
    known = ~np.isnan(y)
    places = np.arange(theta.size) - 1
    columns = theta.size - 1
    single = np.zeros((columns + order + 1, ROWS))
    products = accumulate(theta, places, codes, u, x, y, derivatives=single)
    values = np.concatenate([theta[1:], x])

    def run(moved):
        return simulate(np.concatenate([theta[:1], moved[:columns]]), codes, u, moved[columns:])

    steps = 1e-6 * np.eye(values.size)
    slopes = np.array([(run(values + step) - run(values - step)) / 2e-6 for step in steps])
    rows = np.vstack([slopes, y - run(values)])[:, known]
    assert products == pytest.approx(rows @ rows.T, rel=1e-4, abs=1e-4)
    assert single[:, known] == pytest.approx(rows, rel=1e-4, abs=1e-6)
    assert not single[:, ~known].any()
    assert np.array_equal(accumulate(theta, places, codes, u, x, y), products)


@pytest.mark.parametrize("code", ALL_UNITS)
def test_the_products_of_a_segment_do_not_depend_on_its_lane(code):
    codes = np.array([code, TANH])
    theta, u, x = make_system(codes, 3)
    y, places = np.random.default_rng(4).standard_normal(ROWS), np.arange(theta.size)
    lengths = (ROWS, 40, 200)
    traces = SegmentLanes(Segment(u[:rows], y[:rows]) for rows in lengths).trace(
        theta, codes, np.array([x] * 3)
    )
    for lane, rows in enumerate(lengths):
        alone = accumulate(theta, places, codes, u[:rows], x, y[:rows])
        found = np.empty_like(alone)
        accumulate_products(
            *(theta, places, len(codes), traces, lane, u[:rows], y[:rows], *LIMITS),
            *(theta.size, found, NO_DERIVATIVES),
        )
        # The functions of vectors and of numbers differ by rounding.
        assert found == pytest.approx(alone, rel=1e-9, abs=1e-9)


def test_a_measured_limit_is_left_out_where_the_simulation_is_beyond_it():
    codes = np.array([TANH])
    theta, u, x = make_system(codes)
    y = simulate(theta, codes, u, x)
    lower, upper = np.quantile(y, [0.2, 0.7])
    measured = np.clip(y, lower, upper)
    places = np.arange(theta.size)
    inside = accumulate(theta, places, codes, u, x, measured, (lower, upper))
    y[(measured == lower) | (measured == upper)] = np.nan
    assert np.array_equal(inside, accumulate(theta, places, codes, u, x, y))
    # A simulation that does not reach a measured limit has an error.
    theta[-1] -= 10.0
    inside = accumulate(theta, places, codes, u, x, measured, (lower, upper))
    assert inside[-1, -1] > 50.0 * np.count_nonzero(measured == upper)
