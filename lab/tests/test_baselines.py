"""The baselines of the speed do the work of the kernels: same columns, selection and error."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from islands.estimation.structure_selection.froe import froe
from islands.export.fmu import find_compiler
from islands.expressions.tree import Lagged
from islands.models.narx import Model
from islands.program.regressor_matrix import gram_matrix, regressor_matrix
from islands.records.dataset import Dataset
from islands.simulation.predictors import multiple_shooting
from lab.speed import compiled_c, plain_numpy
from lab.speed.workload import fingerprint, monomial, random_workload, tree

WARM_UP, INTERVAL = 26, 20


@pytest.fixture(scope="module")
def record():
    """Return a record of whole intervals only, more of them than a row of compiled C has lanes."""
    rng = np.random.default_rng(5)
    samples = WARM_UP + 130 * INTERVAL
    u = np.cumsum(rng.normal(size=samples)) / 20
    return Dataset(u - u.mean(), np.sin(u) + 0.01 * rng.normal(size=samples), 0.001)


@pytest.fixture(scope="module")
def candidates():
    return (*random_workload(monomial, 3), *random_workload(tree, 3), *random_workload(monomial, 1, terms=1))


def test_workload_hash_is_reproducible_and_pinned():
    # A change here makes all earlier reports incomparable, because the baseline does other work.
    kinds = {"poly": random_workload(monomial, 30), "general": random_workload(tree, 30)}
    assert fingerprint(kinds).startswith("0023c13333ef")


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


def test_selection_equals_froe(record, candidates):
    for each in candidates[:3]:
        matrix = plain_numpy.columns(each.regressors, record, WARM_UP)
        gram = gram_matrix([*each.regressors, Lagged(0, 0)], record, WARM_UP)
        for tolerance in (0.0, 1e-7, 1e-3):
            selected = plain_numpy.select(matrix, record.y[WARM_UP:], tolerance)
            assert tuple(selected) == froe(gram, tolerance).order
        assert 0 < len(selected) < len(each.regressors)


@pytest.mark.skipif(find_compiler() is None, reason="no C compiler named cc")
@pytest.mark.parametrize("flags", compiled_c.FLAGS)
def test_compiled_c_has_the_error_of_plain_numpy(record, candidates, flags, tmp_path):
    rows = compiled_c.row_pointers(record, WARM_UP, INTERVAL)
    assert rows.lanes > compiled_c.LANES, "two blocks, the second one incomplete"
    for each in (candidates[0], candidates[4]):
        simulate = compiled_c.simulation(each.regressors, each.theta, rows, flags, tmp_path)
        expected = plain_numpy.simulate(each.regressors, each.theta, record, WARM_UP, INTERVAL)
        assert simulate() == pytest.approx(expected, rel=1e-10)
        assert simulate() == simulate()
