"""Models of all outputs: the states that they share, the choice by evidence, and their bands."""

import numpy as np
import pytest

import islands
from islands.facade.coupled.joint_models import (
    choose_candidate,
    exceeds_equations,
    exceeds_latent_models,
    join_candidate,
    list_joint_candidates,
)
from islands.facade.trials.library import take_library
from islands.progress import Steps
from islands.records.coupled import CoupledRecord, split_coupled
from islands.records.dataset import Dataset
from islands.report.documents.result_folder import result_document
from support.coupled_systems import PREY, make_coupled_record
from support.shared_states import make_record
from support.undrawn import undrawn_figures


def make_data(seed=2):
    rng = np.random.default_rng(seed)
    u, x = rng.standard_normal((1400, 2)), np.zeros(2)
    y = np.empty((1400, 2))
    for row, inputs in enumerate(u):
        y[row] = [x[0] + 0.5 * x[1], x[1] - 0.4 * x[0]]
        x = np.array([[0.6, 0.5], [-0.5, 0.6]]) @ x + np.array([[1.0, 0.3], [-0.2, 0.7]]) @ inputs
    y += 0.02 * rng.standard_normal(y.shape)
    records = (Dataset(u, each, 0.1, ("p", "q"), name) for each, name in zip(y.T, "ab", strict=True))
    return split_coupled(CoupledRecord(tuple(records)), 0.3)


@pytest.fixture(scope="module")
def data():
    return make_data()


@pytest.fixture(scope="module")
def candidates(data):
    return list_joint_candidates(data, 1, {}, 0, Steps())


@pytest.fixture(scope="module")
def shared(data, candidates):
    """Return the result of the state space of shared states."""
    (candidate,) = (each for each in candidates if each.assessed.model.shares_states)
    return join_candidate(data, candidate, "", (), {"method": "fit"}, 0, Steps())


@pytest.mark.ci
def test_the_states_occur_once_also_after_the_model_is_read(data, shared, tmp_path):
    model = shared.best.model
    assert len(model.block().starts) == 2
    assert model.linearise().static_gain.shape == (2, 2)
    with undrawn_figures():
        shared.save(tmp_path, figures=())
    saved, record = islands.load(tmp_path), data.validation
    assert saved.best.model == model
    assert saved.outputs == ()
    np.testing.assert_array_equal(saved.simulate(record).y, shared.simulate(record).y)
    np.testing.assert_array_equal(saved.bands(record).lower, shared.bands(record).lower)


@pytest.mark.ci
def test_without_noise_all_candidates_state_the_true_poles(candidates):
    true = np.linalg.eigvals([[0.6, 0.5], [-0.5, 0.6]])
    for each in candidates:
        found = each.assessed.model.linearise().poles
        assert np.abs(found[:, None] - true).min(axis=1).max() < 0.01
    best, reason = choose_candidate(candidates, 1)
    others = [each.assessed.structure for each in candidates if each is not best]
    assert all(each in reason for each in others)
    assert best.assessed.validation_error < 0.005


@pytest.mark.ci
def test_bands_and_standard_errors_contain_the_truth(data, candidates):
    fresh = split_coupled(make_data(7).record, 0.3).estimation
    true = np.array([[0.02439024, 1.30487805], [-1.70731707, -0.14146341]])
    for each in candidates:
        found = join_candidate(data, each, "", (), {"method": "fit"}, 0, Steps())
        band = found.bands(fresh)
        inside = (band.lower <= fresh.y) & (fresh.y <= band.upper)
        assert 0.85 < inside[found.best.warm_up :].mean() < 0.95
        document = result_document(found.search_result)["models"][0]["quantities"]
        gains = [entry for entry in document if entry["name"] == "static gain"]
        errors = np.array([entry["value"] for entry in gains]) - true.ravel()
        assert np.abs(errors / [entry["standard_error"] for entry in gains]).max() < 4.0
        assert len(found.linearise().members) > 10
        text = str(found)
        assert "resonance" in text
        assert "static gain of q on a" in text
        assert found.best.model.parameter_names[0] not in text


@pytest.mark.ci
def test_a_search_is_left_out_only_if_neither_its_states_nor_its_terms_suffice():
    data = split_coupled(make_record(1, (1.0,), 0.0), 0.3)
    candidates = list_joint_candidates(data, 1, {}, 0, Steps())
    one = take_library("polynomial", 1, 1, None)
    assert exceeds_equations(candidates, data, 6, one, Steps())
    assert not exceeds_equations(candidates, data, 60, one, Steps())
    assert not exceeds_latent_models(candidates)
    # A product of two measured outputs replaces states of any number.
    data = split_coupled(make_coupled_record(PREY, samples=400), 0.25)
    candidates = list_joint_candidates(data, 1, {}, 0, Steps())
    product = take_library("polynomial", 2, 2, None)
    assert not exceeds_equations(candidates, data, 1, product, Steps())


def test_models_of_all_outputs_meet_no_constraints(data):
    assert list_joint_candidates(data, 1, {"constraints": "hysteresis"}, 0, Steps()) == []
