"""The baseline does the same work as the kernels: same columns, selection, estimate and error."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from islands.estimation.structure_selection.froe import froe
from islands.expressions.tree import Lagged
from islands.models.narx import Model
from islands.program.regressor_matrix import gram_matrix, regressor_matrix
from islands.simulation.predictors import multiple_shooting
from islands_measurements.speed import plain_numpy

WARM_UP, INTERVAL = 26, 20


def test_columns_equal_the_regressor_matrix(record, candidates):
    for each in candidates:
        matrix = plain_numpy.columns(each.regressors, record, WARM_UP)
        assert_allclose(matrix, regressor_matrix(each.regressors, record, WARM_UP).T, rtol=1e-12, atol=1e-300)


def test_simulation_equals_multiple_shooting(record, candidates):
    predicted = record.samples - WARM_UP
    for each in candidates:
        model = Model(each.regressors, each.theta)
        expected = multiple_shooting(model, record, INTERVAL, WARM_UP).mean_squared_error * predicted
        error = plain_numpy.simulate(each.regressors, each.theta, record, WARM_UP, INTERVAL)
        assert error == pytest.approx(expected, rel=1e-10)


def test_incomplete_interval_is_omitted(record, candidates):
    one = candidates[0]
    whole = plain_numpy.simulate(
        one.regressors, one.theta, record[: WARM_UP + 2 * INTERVAL], WARM_UP, INTERVAL
    )
    cut = plain_numpy.simulate(
        one.regressors, one.theta, record[: WARM_UP + 3 * INTERVAL - 1], WARM_UP, INTERVAL
    )
    assert cut == whole


def test_selection_equals_froe(record, candidates):
    for each in candidates[:3]:
        matrix = plain_numpy.columns(each.regressors, record, WARM_UP)
        gram = gram_matrix([*each.regressors, Lagged(0, 0)], record, WARM_UP)
        for tolerance in (0.0, 1e-7, 1e-3):
            selected = plain_numpy.select(matrix, record.y[WARM_UP:], tolerance)
            assert tuple(selected) == froe(gram, tolerance).order
        assert 0 < len(selected) < len(each.regressors)


def test_selection_does_not_change_the_matrix(record, candidates):
    matrix = plain_numpy.columns(candidates[0].regressors, record, WARM_UP)
    before = matrix.copy()
    plain_numpy.select(matrix, record.y[WARM_UP:])
    assert (matrix == before).all()


@pytest.mark.parametrize("pruned", [False, True])
def test_evaluation_uses_least_squares_and_the_given_parameters(record, candidates, pruned):
    one = candidates[0]
    estimated, error = plain_numpy.evaluate(one.regressors, one.theta, record, WARM_UP, INTERVAL, pruned)
    psi = regressor_matrix(one.regressors, record, WARM_UP)
    residual = record.y[WARM_UP:] - estimated @ psi
    # The residual is orthogonal to every regressor.
    assert np.abs(psi @ residual).max() < 1e-8 * np.linalg.norm(record.y) * np.linalg.norm(psi, axis=1).max()
    assert error == plain_numpy.simulate(one.regressors, one.theta, record, WARM_UP, INTERVAL)
