"""Estimation of the parameters of a latent model on a whole record."""

from dataclasses import replace

import numpy as np
import pytest

from islands.estimation.constraints.checks import check_constraints
from islands.estimation.latent_refit import refit_latent
from islands.records.dataset import join
from islands.records.flat_extremes import find_limits
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


@pytest.mark.parametrize("offset", [0.0, 500.0])
def test_constraints_hold_to_nine_digits_after_a_refit(offset):
    record, text = spring_record(600, noise=0.02), f"fixed-point = 0, {0.3 + offset}; gain = 0.5"
    record = replace(record, y=record.y + offset)
    model = make_model({**SPRING, "level": SPRING["level"] + offset})
    found = refit_latent(model, record, 40, lambda: False, text)
    for check in check_constraints(found, text):
        assert check.met
        assert check.value == pytest.approx(check.target, rel=1e-9)
    assert found.wiring == model.wiring


@pytest.mark.nightly
def test_correct_knowledge_reduces_the_error_of_a_short_noisy_record():
    clean, text = spring_record(2000, seed=50), "fixed-point = 0, 0.3; gain = 0.564"
    errors = {"none": 0.0, text: 0.0}
    gains = {"none": 0.0, text: 0.0}
    for seed in range(6):
        record = spring_record(150, noise=0.15, seed=seed)
        for constraints in errors:
            found = refit_latent(make_model(), record, 40, lambda: False, constraints)
            errors[constraints] += free_run(found, clean, 60).mean_squared_error
            # The slope at another input than the stated one.
            elsewhere = replace(found, operating_inputs=(1.0,))
            true = replace(make_model(), operating_inputs=(1.0,))
            gain, target = (each.linearise().static_gain[0, 0] for each in (elsewhere, true))
            gains[constraints] += abs(gain - target)
    assert errors[text] < 0.7 * errors["none"]
    assert gains[text] < 0.7 * gains["none"]
