"""Constraints in `islands.fit` and `islands.identify`."""

import math

import islands
from support.identifications import BUDGET, record


def test_information_criteria_of_a_result_count_free_parameters():
    """Every model of the hysteresis library has the cluster of y, which fixes one parameter."""
    data = record()
    for found in (islands.fit(data, max_terms=3), islands.identify(data, **BUDGET, seed=0, islands=1)):
        for fitted in found.models:
            assessment = fitted.ranked_model.assessment
            criteria, free = assessment.information, fitted.model.size - len(fitted.physics.clusters)
            samples = found.search_result.split.estimation.samples - assessment.warm_up
            # BIC - AIC = p (log N - 2).
            assert math.isclose(criteria.bic - criteria.aic, free * (math.log(samples) - 2.0), abs_tol=1e-6)
