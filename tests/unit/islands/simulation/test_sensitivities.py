"""Sensitivities, compared with differences of simulations of fourth order."""

import numpy as np
import pytest

from islands.expressions.parsing import parse
from islands.models.narx import make_model
from islands.program.regressor_matrix import regressor_matrix
from islands.records.dataset import Dataset, join
from islands.simulation.predictors import multiple_shooting
from islands.simulation.sensitivities import make_sensitivities

#: Products of two and three outputs, functions of outputs and inputs, and a constant.
TERMS = {
    "y(k-1)": 0.5,
    "y(k-3)": 0.2,
    "y(k-1)^2*y(k-2)": -0.1,
    "u(k-1)": 0.4,
    "u(k-2)*y(k-2)": 0.1,
    "tanh(y(k-1) - 2*y(k-3))*u(k-1)": 0.2,
    "sqrt(y(k-2) + 5)": 0.1,
    "1": 0.05,
}


def make_model_and_record(samples):
    model = make_model((parse(text), theta) for text, theta in TERMS.items())
    rng = np.random.default_rng(samples)
    u = rng.uniform(-1.0, 1.0, samples)
    return model, Dataset(u, 0.3 * rng.standard_normal(samples), 0.1)


def simulate(model, record, interval, theta):
    y = multiple_shooting(model.with_parameters(theta.tolist(), None), record, interval).y
    return y[~np.isnan(y)]


def differentiate(model, record, interval, direction, step=1e-4):
    theta = np.array(model.parameters)
    ahead = [
        simulate(model, record, interval, theta + factor * step * direction) for factor in (-2, -1, 1, 2)
    ]
    return (ahead[0] - 8 * ahead[1] + 8 * ahead[2] - ahead[3]) / (12 * step)


@pytest.mark.parametrize("interval", [1, 7, 40, None])
def test_sensitivities_are_the_derivatives_of_the_predictions(interval):
    """Two segments, blocks of one interval and of many, and intervals that are shorter than the others."""
    model, first = make_model_and_record(250)
    record = join((first, make_model_and_record(410)[1]))
    theta, directions = np.array(model.parameters), np.random.default_rng(0).normal(size=(len(TERMS), 3))
    directions[2, 1] = 0.0
    found = make_sensitivities(model.regressors, record, model.maximum_lag, interval)(theta, directions)
    for row, direction in zip(found, directions.T, strict=True):
        assert row == pytest.approx(differentiate(model, record, interval, direction), rel=1e-8, abs=1e-8)


def test_one_step_ahead_sensitivities_are_the_regressors():
    model, record = make_model_and_record(60)
    found = make_sensitivities(model.regressors, record, 3, 1)(np.array(model.parameters), np.eye(len(TERMS)))
    assert np.array_equal(found, regressor_matrix(model.regressors, record, 3))


def test_sensitivity_whose_squares_overflow_is_zero():
    """The free run stays at zero, and the effect of the input doubles with every sample."""
    model = make_model([(parse("y(k-1)"), 2.0), (parse("u(k-1)"), 0.0), (parse("u(k-2)"), 0.0)])
    record = Dataset(np.ones(1200), np.zeros(1200), 0.1)
    compute = make_sensitivities(model.regressors, record, 2, None)
    assert not compute(np.array(model.parameters), np.eye(3)).any()
    assert compute(np.array([1.0, 0.0, 0.0]), np.eye(3))[1, -1] == 1198.0
