import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter

from islands.estimation.linear.numerators import find_residues, find_rest, map_numerators
from islands.estimation.linear.sections import INTEGRATORS, find_poles, pair_poles

RATES = {
    "lags": [-0.05, -0.07, -0.3],
    "a double lag": [-0.1, -0.1],
    "a resonance": [-0.02 + 0.3j, -0.02 - 0.3j, -0.2],
    "an integrator": [-0.1, 0.0],
    "two integrators": [0.0, 0.0, -0.4],
}


def respond(rates, dead_time, u):
    """Return the states of a chain with numerators 1, s, s^2 ... for an input that is held."""
    order = len(rates)
    a = np.zeros((order + 1, order + 1))
    a[: order - 1, 1:order] = np.eye(order - 1)
    a[order - 1, :order] = -np.poly(rates).real[:0:-1]
    a[order - 1, order] = 1.0
    states, whole = [np.zeros(order)], int(np.floor(dead_time))
    late = expm(a * (dead_time - whole)), expm(a * (1.0 - dead_time + whole))
    for k in range(u.size - 1):
        x = states[-1]
        for step, lag in ((late[0], whole + 1), (late[1], whole)):
            x = (step @ np.append(x, u[k - lag] if k >= lag else 0.0))[:order]
        states.append(x)
    return np.array(states)


@pytest.mark.parametrize("early", [None, 0.3])
@pytest.mark.parametrize("name", RATES)
def test_sections_have_the_response_of_the_system_in_continuous_time(name, early):
    rates = RATES[name]
    random = np.random.default_rng(1)
    u, delay = random.normal(size=120), 3
    free = [np.exp(complex(rate)) for rate in rates if rate != 0.0]
    parts = [*pair_poles(free), *INTEGRATORS[rates.count(0.0)]]
    given = None if early is None else np.array([early])
    mapped = map_numerators(find_residues(find_poles(parts)[None], 1), [part.size for part in parts], given)[
        0
    ]
    columns = []
    for part in parts:
        quotient = lfilter(np.r_[np.zeros(delay + 1), 1.0], np.r_[1.0, part], u)
        columns += [quotient, np.diff(quotient, prepend=0.0)][: part.size]
    columns += [] if early is None else [lfilter(np.r_[np.zeros(delay), 1.0], 1.0, u)]
    found, true = np.array(columns).T @ mapped, respond(rates, delay - (early or 0.0), u)[:, :2]
    for response, state in zip(found.T, true.T, strict=True):
        gain = response @ state / (state @ state)
        np.testing.assert_allclose(response, gain * state, atol=1e-6 * np.abs(response).max())


def test_negative_poles_have_no_continuous_time():
    assert find_residues(np.array([[0.5 + 0j, -0.5]]), 0) is None


@pytest.mark.parametrize("section", [np.array([-0.9]), np.array([-1.5, 0.8])])
def test_states_at_rest_hold_the_output(section):
    # The response to a constant input for ever, and its free decay after the input ends.
    poles, coefficients = np.r_[1.0, section], np.array([0.7, -0.4])[: section.size]
    numerator = coefficients if section.size == 1 else np.array([coefficients.sum(), -coefficients[1]])
    driven = lfilter(np.r_[0.0, numerator], poles, np.repeat([1.0, 0.0], 400))
    states, pulse = find_rest(section) @ coefficients, lfilter([1.0], poles, np.eye(1, 399)[0])
    free = states[0] * pulse + (states[1] * np.diff(pulse, prepend=0.0) if section.size == 2 else 0.0)
    # At the first sample without an input, the output still has its value before.
    np.testing.assert_allclose(free, driven[400:799], atol=1e-9)
