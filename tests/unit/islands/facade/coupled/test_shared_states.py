"""Search of shared states: one result for each output, with one state space and bands."""

import numpy as np
import pytest

import islands
from islands.facade.coupled.joined_results import join_latent_results
from islands.facade.coupled.shared_states import measure_results, search_large_system, search_shared_states
from islands.progress import Steps
from islands.records.coupled import CoupledRecord, split_coupled
from islands.records.dataset import Dataset
from support.undrawn import undrawn_figures


def make_data():
    rng = np.random.default_rng(2)
    u, x = rng.standard_normal((1400, 2)), np.zeros(2)
    y = np.empty((1400, 2))
    for row, inputs in enumerate(u):
        y[row] = [x[0] + 0.5 * x[1], x[1] - 0.4 * x[0]]
        x = np.array([[0.6, 0.5], [-0.5, 0.6]]) @ x + np.array([[1.0, 0.3], [-0.2, 0.7]]) @ inputs
    y += 0.02 * rng.standard_normal(y.shape)
    records = (Dataset(u, each, 0.1, ("p", "q"), name) for each, name in zip(y.T, "ab", strict=True))
    return split_coupled(CoupledRecord(tuple(records)), 0.3)


@pytest.mark.ci
def test_the_joined_model_has_the_states_once_also_after_it_is_read(tmp_path):
    data, steps = make_data(), Steps()
    results = search_shared_states(data, {"method": "fit"}, {}, 0, steps)
    joined = join_latent_results(data, results, 0, steps)
    model = joined.best.model
    assert model.shares_states
    assert len(model.block().starts) == 2
    assert model.linearise().static_gain.shape == (2, 2)
    assert measure_results(results) < 2.0
    assert all(each.best.prediction_bands for each in results)
    with undrawn_figures():
        joined.save(tmp_path, figures=())
    saved = islands.load(tmp_path).best
    assert saved.model == model
    record = data.validation
    np.testing.assert_array_equal(saved.simulate(record).y, joined.best.simulate(record).y)


def test_constraints_and_small_systems_are_left_to_the_separate_searches():
    data = make_data()
    assert search_shared_states(data, {}, {"constraints": "hysteresis"}, 0, Steps()) == []
    assert search_large_system(data, {}, {}, 0, Steps()) == []
