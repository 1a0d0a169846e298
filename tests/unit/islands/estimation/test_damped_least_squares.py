"""Steps of damped least squares."""

import numpy as np
import pytest

from islands.estimation.damped_least_squares import Minimisation


class Straight:
    """A residual that is linear in one parameter, of a given slope."""

    def __init__(self, slope):
        self.slope = slope

    def __call__(self, theta):
        return np.array([1.0, 1.0]) + self.slope * theta[0]

    def differentiate(self, _theta, directions):
        return np.full((directions.shape[1], 2), self.slope)


@pytest.mark.parametrize(("slope", "moves"), [(2.0, True), (1e200, False)])
def test_a_minimisation_ends_also_where_the_derivatives_overflow(slope, moves):
    residual, start = Straight(slope), np.array([3.0 / slope])
    found = Minimisation(residual, start, residual(start), np.eye(1), 1e-9)
    found.advance(50)
    assert found.has_ended
    assert (found.theta != start).any() == moves
