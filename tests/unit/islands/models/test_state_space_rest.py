"""Rest of a state space with static units at constant inputs."""

import numpy as np
import pytest

from islands.models.state_space_rest import find_rest, linearise
from support.latent_systems import make_model


def rest_of(model, u, start=(0.0, 0.0)):
    return find_rest(model.matrices, model.codes, np.array([u]), np.array(start))


@pytest.mark.parametrize("u", [-2.0, 0.0, 1.5])
def test_states_at_rest_do_not_change(u):
    model = make_model()
    x = rest_of(model, u)
    at = linearise(model.matrices, model.codes, x, np.array([u]))
    assert at.after == pytest.approx(x, abs=1e-12)


def test_the_linear_system_has_the_slopes_of_the_units():
    model, x, u, step = make_model(), np.array([0.7, -0.2]), np.array([0.4]), 1e-6
    at = linearise(model.matrices, model.codes, x, u)
    for place, column in enumerate(at.system.A.T):
        moved = x + step * np.eye(2)[place]
        after = linearise(model.matrices, model.codes, moved, u).after
        assert (after - at.after) / step == pytest.approx(column, abs=1e-6)
    assert at.values == pytest.approx([0.7**3])
    assert at.slopes == pytest.approx([3 * 0.7**2])
