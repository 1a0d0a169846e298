"""Estimation of the parameters of a latent model on a whole record."""

from dataclasses import replace

import numpy as np
import pytest

from islands.data.dataset import join
from islands.data.flat_extremes import NO_LIMITS, SensorLimits, find_limits
from islands.data.input_lead import advance_all_inputs
from islands.estimation.latent_refit import refit_latent
from islands.simulation.outcome import EvaluationOutcome
from islands.simulation.predictors import free_run
from support.latent_systems import SPRING, make_model, spring_record

# The kernels of state spaces are compiled at their first use.
pytestmark = pytest.mark.ci


def move(model):
    """Return a model with other parameters, from which the true ones are found."""
    factors = 1.0 + 0.03 * np.cos(np.arange(model.size))
    return model.with_parameters((factors * np.array(model.parameters)).tolist())


def refit(model, record):
    return refit_latent(model, record, 40, lambda: False)


@pytest.mark.parametrize("offset", [0.0, 500.0])
def test_the_free_run_of_a_record_without_noise_is_found(offset):
    parts = [spring_record(400, seed=seed) for seed in (0, 1)]
    record = join(tuple(replace(part, u=10.0 * part.u, y=part.y + offset) for part in parts))
    start = move(make_model({**SPRING, "b1": 0.002, "b2": 0.015, "level": SPRING["level"] + offset}))
    found = refit(start, record)
    assert found.wiring == start.wiring
    assert free_run(found, record, 60).mean_squared_error < 1e-6


def test_inputs_that_are_read_early_give_the_same_parameters():
    record = spring_record(600)
    start = move(make_model())
    early = replace(start, input_names=("u_V+1",))
    found = [refit(start, record), refit(early, advance_all_inputs(record))]
    assert found[0].parameters == pytest.approx(found[1].parameters, rel=1e-3, abs=1e-4)


def test_a_limited_sensor_does_not_bias_the_parameters():
    record = spring_record(1500, noise=0.01)
    limit = float(np.quantile(record.y, 0.85))
    clipped = replace(record, y=np.minimum(record.y, limit))
    limited = replace(move(make_model()), limits=find_limits(clipped.y))
    assert limited.limits == (None, limit)
    errors = []
    for data in (record, clipped):
        model = replace(refit(limited, data), limits=type(limited.limits)())
        errors.append(free_run(model, record, 60).mean_squared_error)
    assert errors[1] < 1.1 * errors[0] < 1.3e-4
    # The limit belongs to the model, whose output is limited as that of the sensor.
    assert free_run(refit(limited, clipped), clipped, 60).mean_squared_error < errors[0]


def test_the_limits_become_those_of_the_record():
    record = spring_record(600)
    lower = float(np.quantile(record.y, 0.1))
    wrong = replace(make_model(), limits=SensorLimits(None, float(np.quantile(record.y, 0.6))))
    found = refit(wrong, replace(record, y=np.maximum(record.y, lower)))
    assert found.limits == (lower, None)
    assert free_run(replace(found, limits=NO_LIMITS), record, 60).mean_squared_error < 1e-6


def test_a_model_that_diverges_is_not_estimated():
    model = make_model({**SPRING, "a1_1": 1.6})
    assert isinstance(refit(model, spring_record(300)), EvaluationOutcome)
