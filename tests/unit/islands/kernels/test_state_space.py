"""State space with units: the kernel is the formula, and its products are those of the derivatives."""

import numpy as np
import pytest

from islands.kernels.state_space import (
    BELL,
    BOUND,
    CUBE,
    NO_DERIVATIVES,
    TANH,
    accumulate_products,
    evaluate_unit,
    simulate_state_space,
)
from islands.models.unit_functions import FUNCTIONS, find_codes

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

#: Single functions, and trees of them.
ALL_UNITS = (*range(TANH, BELL + 1), *find_codes(["tanh(square)", "s*abs", "bell*s*tanh(s*cube)"]).tolist())
ORDER, INPUTS, ROWS = 3, 2, 300

#: Limits of a sensor that has none.
LIMITS = (-np.inf, np.inf)


def make_system(codes, seed=0):
    """Return stable parameters, inputs and initial states."""
    rng = np.random.default_rng(seed)
    n, units = ORDER, len(codes)
    sizes = [n * INPUTS, n, INPUTS, n * units, units, units * (n + INPUTS), units, n, 1]
    a = np.diag(rng.uniform(0.3, 0.8, n)) + 0.05 * rng.standard_normal((n, n))
    theta = np.concatenate([a.ravel(), *(0.2 * rng.standard_normal(size) for size in sizes)])
    return theta, rng.standard_normal((ROWS, INPUTS)), rng.standard_normal(n)


def simulate(theta, codes, u, x):
    y = np.empty(len(u))
    assert simulate_state_space(theta, codes, u, x.copy(), y) == len(u)
    return y


def test_the_simulation_is_the_formula():
    codes = np.array([TANH, CUBE])
    theta, u, x = make_system(codes)
    n, units, width = ORDER, 2, ORDER + INPUTS
    parts = np.split(
        theta, np.cumsum([n * n, n * INPUTS, n, INPUTS, n * units, units, units * width, units, n])
    )
    shapes = [(n, n), (n, INPUTS), (n,), (INPUTS,), (n, units), (units,), (units, width), (units,), (n,)]
    a, b, c, d, e, f, w, s, o = (part.reshape(shape) for part, shape in zip(parts[:-1], shapes, strict=True))
    expected, state = [], x
    for row in u:
        argument = w @ np.concatenate([state, row]) + s
        h = np.array([np.tanh(argument[0]), argument[1] ** 3])
        expected.append(c @ state + d @ row + f @ h + parts[-1][0])
        state = a @ state + b @ row + e @ h + o
    assert simulate(theta, codes, u, x) == pytest.approx(np.array(expected), abs=1e-12)
    last = x.copy()
    simulate_state_space(theta, codes, u, last, np.empty(ROWS))
    assert last == pytest.approx(state, abs=1e-12)


@pytest.mark.parametrize("code", ALL_UNITS)
def test_the_slope_of_a_unit_is_the_derivative_of_its_value(code):
    for s in (-1.7, -0.6, 0.3, 1.4):
        ahead, behind = (evaluate_unit(code, s + step)[0] for step in (1e-6, -1e-6))
        assert evaluate_unit(code, s)[1] == pytest.approx((ahead - behind) / 2e-6, abs=1e-6)


@pytest.mark.parametrize("code", ALL_UNITS)
def test_the_products_are_those_of_the_derivatives_and_the_error(code):
    codes = np.array([TANH, code])
    theta, u, x = make_system(codes, code % 1000)
    y = simulate(theta, codes, u, x) + 0.1 * np.random.default_rng(9).standard_normal(ROWS)
    y[[0, 7, ROWS - 1]] = np.nan
    known = ~np.isnan(y)
    places = np.arange(theta.size) - 4
    places[:4] = -1
    columns = theta.size - 4
    products = np.empty((columns + ORDER + 1,) * 2)
    single = np.zeros((columns + ORDER + 1, ROWS))
    assert accumulate_products(theta, places, codes, u, x, y, *LIMITS, columns, products, single) == ROWS
    values = np.concatenate([theta[4:], x])

    def run(moved):
        return simulate(np.concatenate([theta[:4], moved[:columns]]), codes, u, moved[columns:])

    steps = 1e-6 * np.eye(values.size)
    slopes = np.array([(run(values + step) - run(values - step)) / 2e-6 for step in steps])
    rows = np.vstack([slopes, y - run(values)])[:, known]
    assert products == pytest.approx(rows @ rows.T, rel=1e-4, abs=1e-4)
    assert single[:, known] == pytest.approx(rows, rel=1e-4, abs=1e-6)
    assert not single[:, ~known].any()


def test_a_measured_limit_is_left_out_where_the_simulation_is_beyond_it():
    codes = np.array([TANH])
    theta, u, x = make_system(codes)
    y = simulate(theta, codes, u, x)
    lower, upper = np.quantile(y, [0.2, 0.7])
    measured = np.clip(y, lower, upper)
    places, size = np.arange(theta.size), theta.size + ORDER + 1
    inside, missing = np.empty((size, size)), np.empty((size, size))
    accumulate_products(
        theta, places, codes, u, x, measured, lower, upper, theta.size, inside, NO_DERIVATIVES
    )
    y[(measured == lower) | (measured == upper)] = np.nan
    accumulate_products(theta, places, codes, u, x, y, *LIMITS, theta.size, missing, NO_DERIVATIVES)
    assert np.array_equal(inside, missing)
    # A simulation that does not reach a measured limit has an error.
    theta[-1] -= 10.0
    accumulate_products(
        theta, places, codes, u, x, measured, lower, upper, theta.size, inside, NO_DERIVATIVES
    )
    assert inside[-1, -1] > 50.0 * np.count_nonzero(measured == upper)


def test_units_have_the_codes_of_the_kernel():
    values = {
        "tanh": np.tanh(0.7),
        "cube": 0.7**3,
        "hinge": 0.7,
        "root": 0.7**0.5,
        "dead zone": 0.0,
        "bell": np.exp(-0.49),
    }
    for name, value in values.items():
        (code,) = find_codes([name])
        assert evaluate_unit(code, 0.7)[0] == pytest.approx(value)
    assert len(FUNCTIONS) == BELL


def test_a_divergence_ends_the_simulation_at_its_row():
    theta = np.array([2.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    y, products = np.empty(100), np.empty((2, 2))
    rows = simulate_state_space(theta, np.zeros(0, np.int64), np.ones((100, 1)), np.ones(1), y)
    # x(k) = 2^(k+1) - 1 exceeds the bound.
    assert rows == int(np.log2(BOUND)) - 1
    fixed = np.full(theta.size, -1)
    found = accumulate_products(
        *(theta, fixed, np.zeros(0, np.int64), np.ones((100, 1)), np.ones(1), np.ones(100), *LIMITS),
        *(0, products, NO_DERIVATIVES),
    )
    assert found == rows


def test_derivatives_that_decay_end_at_zero():
    # The derivative with respect to the initial state is 0.9^k: subnormal from k = 6 700 on.
    theta = np.array([0.9, 1.0, 1.0, 0.0, 0.0, 0.0])
    fixed, rows = np.full(theta.size, -1), 8000
    products, single = np.empty((2, 2)), np.zeros((2, rows))
    zeros = np.zeros(rows)
    accumulate_products(
        *(theta, fixed, np.zeros(0, np.int64), np.zeros((rows, 1)), np.zeros(1), zeros, *LIMITS),
        *(0, products, single),
    )
    assert single[0, :3000] == pytest.approx(0.9 ** np.arange(3000), rel=1e-9)
    assert not single[0, 4000:].any()
    assert products[0, 0] == pytest.approx(1.0 / (1.0 - 0.81))
