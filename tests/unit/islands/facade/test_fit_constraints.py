"""Constraints in `islands.fit` and `islands.identify`."""

import math

import numpy as np
import pytest

import islands
from islands.errors import SettingsError
from islands.estimation.constraints.checks import check_constraints
from islands.estimation.estimate import estimate
from islands.estimation.refinement import refine
from islands.expressions.parsing import parse
from islands.models.narx import canonical_order
from islands.models.regressor import regressor
from islands.records.dataset import Dataset
from support.identifications import BUDGET, identify, record
from support.levels import nightly_but

LAW = {"y(k-1)": 0.6, "u(k-1)": 0.5, "u(k-2)": 0.3, "u(k-1)^3": 0.1}

#: Statements that the law meets.
TRUE = (
    "gain = 2",
    "fixed-point = 1, 2.25",
    "gain = 2; fixed-point = 1, 2.25",
    "odd",
    "[u(k-1)] - [u(k-2)] = 0.2; [y(k-1)] >= 0",
    "odd; gain = 2.75 at 1, 2.25",
)


def make_record(samples=300, seed=0, noise=0.1):
    """Return a record of the law with noise on the output."""
    rng = np.random.default_rng(seed)
    u, y = rng.uniform(-1, 1, samples), np.zeros(samples)
    for k in range(2, samples):
        y[k] = 0.6 * y[k - 1] + 0.5 * u[k - 1] + 0.3 * u[k - 2] + 0.1 * u[k - 1] ** 3
    return Dataset(u, y + noise * rng.normal(size=samples), 1.0)


def terms(*names):
    return canonical_order(regressor(parse(name))[1] for name in names)


def worst_residual(model, text):
    """Return the largest deviation from a target, computed apart from the estimation."""
    return max((abs(check.value - check.target) for check in check_constraints(model, text)), default=0.0)


@pytest.mark.parametrize("text", TRUE)
def test_fitted_and_refined_parameters_meet_the_constraints(text):
    data = make_record()
    fitted = estimate(terms(*LAW, "u(k-2)^3", "y(k-2)"), data, text).model
    refined = refine(fitted, data, 30, text)
    assert refined.after < refined.before
    for model in (fitted, refined.model):
        checks = check_constraints(model, text)
        assert all(check.met for check in checks)
        if ">=" not in text:
            assert worst_residual(model, text) < 1e-9


def test_term_with_the_wrong_sign_is_removed():
    data = make_record()
    free = estimate(terms(*LAW), data).model
    bound = estimate(terms(*LAW), data, "[u(k-2)] <= 0").model
    assert free.theta[2] > 0.0
    assert bound == estimate(terms(*(name for name in LAW if name != "u(k-2)")), data).model
    assert estimate(terms(*LAW), data, "[u(k-2)] >= 0").model == free


#: Settings with which a search takes a fraction of a second and has few seeds.
SEARCH = {
    "preset": "narx",
    "population": 40,
    "generations": 1,
    "max_terms": 5,
    "shooting": 30,
    "library_degree": 3,
    "library_lags": 2,
    "islands": 1,
}


@pytest.mark.ci
@pytest.mark.parametrize(
    "text",
    nightly_but(
        ("gain = 2; fixed-point = 1, 2.25", "hysteresis; [u(k-1)] >= 0"),
        [*TRUE, "[u(k-2)] - [u(k-1)] = -0.2", "hysteresis; [u(k-1)] >= 0"],
    ),
)
def test_every_identified_model_meets_its_constraints(text):
    result = islands.identify(make_record(), **SEARCH, constraints=text)
    assert result.models
    assert result.search_result.settings["constraints"] == text
    for fitted in result.models:
        assert all(check.met for check in fitted.constraints)
        if ">=" not in text:
            assert worst_residual(fitted.model, text) < 1e-9
    outcomes = result.search_result.search.outcomes
    assert outcomes["ok"] + outcomes.get("abandoned", 0) > 0.5 * sum(outcomes.values())


def test_statement_that_the_record_does_not_fit_raises_settings_error():
    for search in (islands.fit, islands.identify):
        with pytest.raises(SettingsError, match="correct one of them"):
            search(make_record(), constraints="fixed-point = 1, 2, 3")


def test_information_criteria_of_a_result_count_free_parameters():
    """Every model of the hysteresis library has the cluster of y, which fixes one parameter."""
    data = record()
    for found in (islands.fit(data, library="phi-polynomial", max_terms=3), identify(data, **BUDGET, seed=0)):
        for fitted in found.models:
            assessment = fitted.assessment
            criteria, free = assessment.information, fitted.model.size - len(fitted.physics.clusters)
            samples = found.search_result.split.estimation.samples - assessment.warm_up
            # BIC - AIC = p (log N - 2).
            assert math.isclose(criteria.bic - criteria.aic, free * (math.log(samples) - 2.0), abs_tol=1e-6)
