"""State space with units: the kernel is the formula."""

import numpy as np
import pytest

from islands.kernels.state_space import (
    BELL,
    BOUND,
    CUBE,
    TANH,
    evaluate_unit,
    simulate_state_space,
    trace_states,
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
    y = np.empty(100)
    rows = simulate_state_space(theta, np.zeros(0, np.int64), np.ones((100, 1)), np.ones(1), y)
    # x(k) = 2^(k+1) - 1 exceeds the bound.
    assert rows == int(np.log2(BOUND)) - 1
    none = np.zeros(0, np.int64)
    traces = np.empty((100, 1, 1))
    assert trace_states(theta, none, np.ones((100, 1)), np.ones(1), traces) == rows
