"""Latent models with shared states: the true poles, and an amplitude that acts in the free run."""

import numpy as np
import pytest

from islands.estimation.shared_states import search_shared_models
from islands.models.coupled_latent import CoupledLatentModel
from islands.progress import Steps
from islands.records.coupled import CoupledRecord
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run

POLES = np.array([0.8 * np.exp(0.7j), 0.8 * np.exp(-0.7j), 0.85 * np.exp(1.9j), 0.85 * np.exp(-1.9j)])
A = np.zeros((4, 4))
for _at, _pole in ((0, POLES[0]), (2, POLES[2])):
    A[_at : _at + 2, _at : _at + 2] = [[_pole.real, _pole.imag], [-_pole.imag, _pole.real]]
B = np.array([[1.0, 0.2], [0.3, -0.7], [0.4, 0.9], [-0.6, 0.5]])
C = np.array([[1.0, 0.3, -0.5, 0.2], [0.2, 0.8, 0.4, -0.9]])


def make_record(seed, levels, softening, samples=2000):
    """Return recordings of a system whose poles turn more slowly the larger the level of the inputs is."""
    rng = np.random.default_rng(seed)
    u = np.concatenate([level * rng.standard_normal((samples, 2)) for level in levels])
    y, x = np.empty((len(u), 2)), np.zeros(4)
    for row, inputs in enumerate(u):
        y[row] = C @ x
        x = (A - softening * levels[row // samples] * B @ C) @ x + B @ inputs
    y += 0.02 * y.std(axis=0) * rng.standard_normal(y.shape)
    segments = (samples,) * len(levels)
    return CoupledRecord(
        tuple(
            Dataset(u, column, 0.01, ("p_V", "q_V"), name, segments=segments)
            for column, name in zip(y.T, ("a_m", "b_m"), strict=True)
        )
    )


def find_errors(models, record):
    run = free_run(CoupledLatentModel(models), record)
    return np.sqrt(run.mean_squared_errors) / record.y.std(axis=0)


@pytest.mark.ci
def test_both_outputs_share_the_poles_of_the_plant():
    (models,) = search_shared_models(make_record(1, (1.0,), 0.0), 0, Steps())
    assert [each.order for each in models] == [4, 4]
    assert CoupledLatentModel(models).shares_states
    found = models[1].linearise().poles
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(POLES), atol=0.01)
    assert find_errors(models, make_record(2, (1.0,), 0.0)).max() < 0.03


@pytest.mark.ci
def test_the_effect_of_the_amplitude_predicts_a_level_between():
    linear, scheduled = search_shared_models(make_record(1, (1.0, 2.0, 3.0) * 2, 0.08), 0, Steps())
    fresh = make_record(5, (1.4,), 0.08)
    assert find_errors(scheduled, fresh).max() < 0.5 * find_errors(linear, fresh).max()


def test_a_short_record_has_no_shared_states():
    assert search_shared_models(make_record(1, (1.0,), 0.0, 200), 0, Steps()) == []
