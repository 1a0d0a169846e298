"""The choice of the estimator in `fit` and `identify`."""

import numpy as np
import pytest

from islands.estimation.estimate import estimate
from islands.estimation.estimator_table import ESTIMATORS
from islands.estimation.estimators import estimate_with
from islands.facade.fit import fit
from islands.facade.identify import identify
from islands.models.narx import Model
from support.noisy_records import make_noisy_record

BUDGET = {"preset": "narx", "population": 20, "generations": 2, "max_terms": 3, "shooting": 50}


def coefficients(model):
    return dict(zip((item.text for item in model.regressors), model.theta, strict=True))


@pytest.mark.ci
def test_fit_estimates_with_the_chosen_estimator():
    record = make_noisy_record("output", 0, 1500)
    poles = {}
    for name in ESTIMATORS:
        result = fit(
            record, library="polynomial", degree=2, lags=1, max_terms=3, estimator=name, shooting=100
        )
        model = next(entry.model for entry in result.models if entry.model.size == 3)
        poles[name] = coefficients(model)["y(k-1)"]
        part = result.search_result.split.estimation
        expected = estimate_with(name, estimate(model.regressors, part), part, shooting=100)
        assert model.theta == expected.model.theta
        assert result.search_result.settings["estimator"] == name
    assert poles["least-squares"] < 0.895 < min(poles["free-run"], poles["extended-least-squares"])


@pytest.mark.ci
@pytest.mark.parametrize(
    "estimator", ["extended-least-squares", pytest.param("free-run", marks=pytest.mark.nightly)]
)
def test_identify_estimates_all_models_with_the_chosen_estimator(estimator):
    record = make_noisy_record("arma", 0, 800)
    result = identify(record, **BUDGET, estimator=estimator)
    part = result.search_result.split.estimation
    equations = [each for each in result.models if isinstance(each.model, Model)]
    assert len(equations) >= 2
    for entry in equations:
        start = estimate(entry.model.regressors, part, "none", entry.warm_up)
        expected = estimate_with(estimator, start, part, "none", entry.warm_up, BUDGET["shooting"])
        np.testing.assert_allclose(entry.model.theta, expected.model.theta, rtol=1e-9)


@pytest.mark.ci
def test_bias_of_least_squares_is_reported_for_a_model_of_a_result():
    found = {}
    for noise in ("equation", "output"):
        result = fit(make_noisy_record(noise, 0, 1500), library="polynomial", degree=2, lags=1, max_terms=3)
        best = next(entry for entry in result.models if entry.model.size == 3)
        found[noise] = best.least_squares_bias
    assert found["equation"] < 2.0
    assert found["output"] > 10.0
