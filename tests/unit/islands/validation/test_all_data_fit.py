"""Evidence of a model: its errors with the parameters of all data."""

import numpy as np
import pytest

import islands
from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import LEAST_SQUARES, refinement_criterion
from islands.models.regressor import Regressor
from islands.records.dataset import Dataset
from islands.records.split import split
from islands.validation.all_data_fit import AllDataFit
from islands.validation.evidence import measure_errors

TERMS = ("y(k-1)", "u(k-1)", "u(k-1)^2")


def make_staircase(seed):
    """Return a tank-like record whose input reaches new values in the last quarter only."""
    rng = np.random.default_rng(seed)
    u, y = np.repeat(np.linspace(0.0, 3.0, 16), 40), np.zeros(640)
    for k in range(1, 640):
        y[k] = 0.9 * y[k - 1] + 0.1 * u[k - 1] + 0.1 * u[k - 1] ** 2
    return Dataset(u, y + 0.01 * rng.standard_normal(640), 1.0)


def fit_terms(record, terms=TERMS):
    return estimate([Regressor(islands.parse(each)) for each in terms], record).model


def fit_all(model, criterion, parts):
    return AllDataFit(model, criterion, parts, "none", 1, measure_errors(model, parts, 1))


@pytest.mark.parametrize("criterion", [LEAST_SQUARES, refinement_criterion(None)])
@pytest.mark.parametrize("seed", [0, 1])
def test_no_fit_has_larger_errors_than_the_given_parameters(criterion, seed):
    parts = split(make_staircase(seed))
    model = fit_terms(parts.estimation)
    given, fitted = (fit_all(model, each, parts) for each in (None, criterion))
    assert given.model == model
    assert np.nanmean(fitted.errors**2) <= np.nanmean(given.errors**2)


def test_the_parameters_of_a_free_run_fit_do_not_depend_on_which_part_is_held_out():
    record = make_staircase(2)
    runs = [
        fit_all(fit_terms(parts.estimation), refinement_criterion(None), parts).model
        for parts in (split(record, 0.25), split(record, 0.5))
    ]
    np.testing.assert_allclose(runs[0].theta, runs[1].theta, rtol=2e-2)
