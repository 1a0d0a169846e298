"""Static models: the curve of a sensor is found down to the noise, whatever the order of its samples."""

import numpy as np
import pytest

from islands.estimation.static_models import identify_static_models
from islands.models.form import is_static
from islands.progress import Steps, StoppedError
from islands.records.dataset import Dataset
from islands.records.input_lead import advance_all_inputs
from islands.simulation.initial_outputs import simulate_freely

NOISE = 0.01

LAWS = {
    "thermistor": (lambda u: 1.0 / (1.0 / 298.15 + np.log(u / 10.0) / 3950.0) - 273.15, 1.0, 30.0),
    "titration": (lambda u: 7.0 + 1.3 * np.arcsinh(2.7 * (u - 25.0)), 0.0, 50.0),
    "orifice": (lambda u: 2.3 * np.sqrt(u), 0.0, 40.0),
    "limiter": (lambda u: np.clip(u, -2.0, 2.0), -5.0, 5.0),
}


def measure(law, u, seed):
    """Return the record of a law with its inputs at the same sample, and the size of the noise."""
    y = law(u)
    noise = NOISE * np.ptp(y)
    measured = y + noise * np.random.default_rng(seed).standard_normal(len(y))
    return advance_all_inputs(Dataset(u, measured, 1.0)), noise


def find_least_error(models, record):
    return min(simulate_freely(model, record).mean_squared_error for model in models) ** 0.5


@pytest.mark.parametrize(
    "name",
    [
        "thermistor",
        "limiter",
        *(pytest.param(name, marks=pytest.mark.ci) for name in ("titration", "orifice")),
    ],
)
def test_the_curve_of_a_sensor_is_found_in_any_order_of_its_samples(name):
    law, low, high = LAWS[name]
    u = np.random.default_rng(0).uniform(low, high, 400)
    record, _ = measure(law, np.sort(u), 1)
    fresh, noise = measure(law, u, 2)
    models = identify_static_models(record, Steps())
    assert all(map(is_static, models))
    assert find_least_error(models, fresh) < 1.25 * noise


def test_the_flow_through_a_valve_is_a_product():
    u = np.random.default_rng(0).uniform([0.1, 0.5], [1.0, 6.0], (100, 2))
    record, noise = measure(lambda u: 8.0 * u[:, 0] * np.sqrt(u[:, 1]), u, 1)
    models = identify_static_models(record, Steps())
    first = next(each for each in models if each.kind == "narx")
    assert first.size == 1
    assert first.theta == pytest.approx([8.0], rel=NOISE)
    assert find_least_error([first], record) < 1.1 * noise


def test_gains_come_without_curves():
    u = np.random.default_rng(0).uniform(0.0, 1.0, (300, 2))
    record, noise = measure(lambda u: 2.0 + u @ [1.0, -3.0], u, 1)
    gains = identify_static_models(record, Steps())[0]
    assert (gains.order, gains.units) == (0, ())
    assert gains.linearise().static_gain[0] == pytest.approx([1.0, -3.0], rel=0.01)
    assert find_least_error([gains], record) < 1.1 * noise


def test_a_stop_ends_the_identification():
    record, _ = measure(np.sqrt, np.arange(100.0), 0)
    with pytest.raises(StoppedError):
        identify_static_models(record, Steps(stop=lambda: True))
