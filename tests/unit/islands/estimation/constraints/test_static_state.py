"""Output and slope of a state space at rest, and their derivatives."""

import numpy as np
import pytest

from islands.estimation.constraints.static_state import StateSpaceParameters, find_static_state
from islands.models.latent import StateSpaceLayout
from islands.models.unit_functions import FUNCTIONS, find_codes
from support.latent_systems import make_model

LAYOUT = StateSpaceLayout(3, 2, 3)


def make_system(units, seed=0):
    theta = 0.3 * np.random.default_rng(seed).standard_normal(len(LAYOUT.names))
    return StateSpaceParameters(LAYOUT, theta, find_codes(units))


def measure(system, u, channel):
    return find_static_state(system, u).measure(channel).total


@pytest.mark.parametrize("channel", [0, 1, 2])
@pytest.mark.parametrize("unit", [*FUNCTIONS, "tanh(square)", "s*abs"])
def test_the_derivatives_are_those_of_differences(unit, channel):
    system, u, step = make_system((unit, "tanh", unit)), np.array([0.4, -0.7]), 1e-6
    found = find_static_state(system, u).differentiate(channel)
    for place, slope in enumerate(found):
        above, below = (
            measure(system.with_theta(system.theta + sign * step * np.eye(len(found))[place]), u, channel)
            for sign in (1.0, -1.0)
        )
        assert slope == pytest.approx((above - below) / (2.0 * step), rel=1e-5, abs=1e-6)


def test_an_integrator_has_neither_rest_nor_derivatives():
    model = make_model({"a1_1": 1.0, "b1": 1.0, "c1": 1.0}, (), 1)
    system = StateSpaceParameters(model.layout, model.theta, model.codes)
    assert find_static_state(system, np.ones(1)) is None
