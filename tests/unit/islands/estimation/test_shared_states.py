"""Latent models with shared states: the true poles, an amplitude that acts in the free run, and draws."""

import numpy as np
import pytest

from islands.estimation.shared_states import search_shared_models
from islands.progress import Steps
from islands.simulation.predictors import free_run
from support.shared_states import POLES, A, B, C, make_record


def find_errors(model, record):
    return np.sqrt(free_run(model, record).mean_squared_errors) / record.y.std(axis=0)


@pytest.mark.ci
def test_both_outputs_share_the_poles_of_the_plant():
    (found,) = search_shared_models(make_record(1, (1.0,), 0.0), 0, Steps())
    model = found.model
    assert [each.order for each in model.models] == [4, 4]
    assert model.shares_states
    poles = model.models[1].linearise().poles
    np.testing.assert_allclose(np.sort_complex(poles), np.sort_complex(POLES), atol=0.01)
    assert find_errors(model, make_record(2, (1.0,), 0.0)).max() < 0.03


@pytest.mark.ci
def test_the_effect_of_the_amplitude_predicts_a_level_between():
    linear, scheduled = search_shared_models(make_record(1, (1.0, 2.0, 3.0) * 2, 0.08), 0, Steps())
    fresh = make_record(5, (1.4,), 0.08)
    assert find_errors(scheduled.model, fresh).max() < 0.5 * find_errors(linear.model, fresh).max()


@pytest.mark.nightly
def test_the_draws_have_the_spread_of_the_estimate():
    true = C @ np.linalg.solve(np.eye(4) - A, B)
    deviations = []
    for seed in range(30):
        (found,) = search_shared_models(make_record(seed, (1.0,), 0.0, 1000), seed, Steps())
        if found.model.models[0].order != 4:
            continue
        systems = [found.model.with_parameters(each).linearise() for each in found.draws.tolist()]
        gains = np.array([each.static_gain for each in systems])
        deviations.append((found.model.linearise().static_gain - true) / gains.std(axis=0))
    assert len(deviations) > 20
    inside = np.mean(np.abs(deviations) < 1.96)
    assert 0.85 < inside <= 1.0
    assert 0.7 < np.std(deviations) < 1.4


def test_a_short_record_has_no_shared_states():
    assert search_shared_models(make_record(1, (1.0,), 0.0, 200), 0, Steps()) == []
