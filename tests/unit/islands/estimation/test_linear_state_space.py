"""Linear state spaces: the poles and the response of the system, states of the standard deviation 1."""

import numpy as np
import pytest

from islands.estimation.linear_state_space import fit_linear_state_space
from islands.kernels.state_space import simulate_state_space
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_inputs

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci

A = np.array([[0.9, 0.2], [-0.2, 0.8]])
B = np.array([[0.3, 0.0], [0.1, 0.5]])
C = np.array([1.0, -0.5])


def make_record(direct=(0.0, 0.0), noise=0.0, samples=800):
    rng = np.random.default_rng(0)
    u = rng.standard_normal((samples, 2))
    x, y = np.zeros(2), np.zeros(samples)
    for k in range(samples):
        y[k] = C @ x + np.dot(direct, u[k]) + 0.7
        x = A @ x + B @ u[k]
    return Dataset(u, y + noise * rng.standard_normal(samples), 1.0)


@pytest.mark.parametrize("direct", [(0.0, 0.0), (0.4, -0.2)])
def test_the_model_of_a_linear_system_has_its_poles_and_its_response(direct):
    record = make_record(direct)
    found = fit_linear_state_space(advance_inputs(record, [0, 1]), 2)
    assert sorted(np.linalg.eigvals(found.a).imag) == pytest.approx(
        sorted(np.linalg.eigvals(A).imag), abs=1e-6
    )
    assert found.d == pytest.approx(np.array(direct), abs=1e-6)
    y = np.empty(record.samples)
    simulate_state_space(found.theta, np.zeros(0, np.int64), record.u, np.zeros(2), y)
    assert y[200:] == pytest.approx(record.y[200:], abs=1e-5)


def test_a_record_that_is_too_short_has_no_model():
    assert fit_linear_state_space(make_record()[:20], 4) is None
