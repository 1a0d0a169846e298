"""Initial outputs of a free run: estimated where their noise matters, and measured elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from islands.expressions.parsing import parse
from islands.models.latent import LatentModel
from islands.models.narx import make_model
from islands.simulation.initial_outputs import estimate_initial_outputs, simulate_freely
from islands.simulation.predictors import free_run
from support.slow_processes import TANK_NOISE, make_tank

TANK = make_model([(parse("y(k-1)"), 1.0), (parse("u(k-1)"), 0.02)], ("q",), "h")


def law(**terms):
    return make_model([(parse(text), value) for text, value in terms.items()], ("q",), "h")


def rmse(run):
    return run.mean_squared_error**0.5


def test_free_run_of_an_integrator_has_the_error_of_the_noise():
    measured, estimated = [], []
    for seed in range(20):
        record = make_tank(seed, 400)
        measured.append(rmse(free_run(TANK, record)))
        estimated.append(rmse(simulate_freely(TANK, record)))
    assert max(estimated) < 1.15 * TANK_NOISE
    assert max(measured) > 1.8 * TANK_NOISE


def test_error_of_a_wrong_model_is_not_taken_for_noise():
    record = make_tank(0, 400, noise=1e-5)
    wrong = law(**{"y(k-1)": 1.0, "u(k-1)": 0.01})
    assert estimate_initial_outputs(wrong, record) is record


def test_known_outputs_are_used_and_missing_ones_are_not_needed():
    record = make_tank(5, 400)
    y = np.array(record.y)
    y[60:] = np.nan
    some = estimate_initial_outputs(TANK, replace(record, y=y))
    assert some.y[0] == pytest.approx(1.0, abs=0.5 * TANK_NOISE)
    y[1:] = np.nan
    first_only = replace(record, y=y)
    assert estimate_initial_outputs(TANK, first_only) is first_only


def test_initial_outputs_of_a_nonlinear_model_are_estimated():
    # A logistic growth without input; its initial value shifts the curve in time.
    model = law(**{"y(k-1)": 1.02, "y(k-1)^2": -0.02})
    record = make_tank(0, 600)
    y = np.empty(600)
    y[0] = 0.02
    for k in range(1, 600):
        y[k] = 1.02 * y[k - 1] - 0.02 * y[k - 1] ** 2
    noisy = replace(record, y=y + np.random.default_rng(1).normal(0, 0.005, 600))
    assert rmse(simulate_freely(model, noisy)) < 1.1 * 0.005
    assert rmse(free_run(model, noisy)) > 2.0 * 0.005


def test_diverging_free_run_starts_from_the_measured_outputs():
    record = make_tank(0, 400)
    model = law(**{"y(k-1)": 1.2, "u(k-1)": 0.02})
    assert estimate_initial_outputs(model, record) is record
    assert not simulate_freely(model, record).outcome


def test_the_states_of_a_latent_model_are_estimated_from_as_many_samples():
    parameters = {"a1_1": 1.0, "b1": 0.02, "c1": 1.0}
    model = LatentModel(
        parameters=tuple(parameters.values()),
        wiring=tuple(parameters),
        input_names=("q",),
        output_name="h",
        order=1,
        units=(),
        memory=4,
        operating_inputs=(0.0,),
    )
    records = [make_tank(seed, 400) for seed in range(20)]
    runs = [(free_run(model, record), simulate_freely(model, record)) for record in records]
    assert max(rmse(measured) for measured, _ in runs) > 1.3 * TANK_NOISE
    assert max(rmse(estimated) for _, estimated in runs) < 1.15 * TANK_NOISE
