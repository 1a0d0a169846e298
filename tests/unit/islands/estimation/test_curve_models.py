"""Linear systems with one curve: what is found of records with one, and of linear ones."""

import numpy as np
import pytest

from islands.estimation.curve_models import identify_curve_models
from islands.progress import Steps, StoppedError
from islands.records.dataset import Dataset
from islands.simulation.initial_outputs import simulate_freely

NOISE = 1e-3


def make_record(act, relax, samples=300):
    """Return the record of a lag that reads a function of its input, and loses one of its output."""
    generator = np.random.default_rng(3)
    u = np.repeat(generator.uniform(-1.0, 1.0, samples // 10), 10)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = y[k - 1] + 0.2 * act(u[k - 1]) - 0.2 * relax(y[k - 1])
    return Dataset(u, y + NOISE * generator.standard_normal(samples), 0.1)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("act", "relax"),
    [(lambda u: np.tanh(3.0 * u), float), (float, lambda y: y + 2.0 * y**3)],
    ids=["of the input", "of the output"],
)
def test_a_curve_is_found_down_to_the_noise(act, relax):
    record = make_record(act, relax)
    model = identify_curve_models(record, Steps())[-1]
    assert (model.order, len(model.units)) == (1, 1)
    assert simulate_freely(model, record).mean_squared_error ** 0.5 < 1.3 * NOISE


@pytest.mark.ci
def test_a_linear_record_has_no_model_with_a_curve():
    assert not identify_curve_models(make_record(float, float), Steps())


def test_a_stop_ends_the_identification():
    with pytest.raises(StoppedError):
        identify_curve_models(make_record(np.tanh, float), Steps(stop=lambda: True))
