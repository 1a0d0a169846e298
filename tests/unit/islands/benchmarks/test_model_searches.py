"""Searches that a benchmark compares: one for each class, with a reason where it has no model."""

import numpy as np
import pytest

import islands
from islands.benchmarks.definition import CLASSES, LATENT, LINEAR, NARX
from islands.benchmarks.model_searches import MODEL_SEARCHES, count_terms
from islands.models.coupled_latent import CoupledLatentModel
from islands.models.latent import LatentModel
from islands.progress import ignore_progress, never_stop
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from support.coupled_systems import TWO_MASSES
from support.latent_systems import curves_record, make_coupled_latent_model, make_model, smooth_input


def search(kind, record):
    return MODEL_SEARCHES[kind].find(record, 0, ignore_progress, never_stop)


def find(kind, record):
    return search(kind, record).model


def test_every_class_has_a_search():
    assert tuple(MODEL_SEARCHES) == CLASSES
    assert [each for each in CLASSES if MODEL_SEARCHES[each].is_random] == [LATENT]


@pytest.mark.parametrize(
    "kind", [pytest.param(LATENT, marks=pytest.mark.nightly), pytest.param(LINEAR, marks=pytest.mark.ci)]
)
def test_every_output_of_several_has_a_latent_model(kind):
    record = curves_record(300, 4)
    found = search(kind, record)
    model = found.model
    assert isinstance(model, CoupledLatentModel)
    assert (len(found.bands), found.claimed is None) == ((2, False) if kind == LATENT else (0, True))
    assert model.output_names == record.output_names
    assert count_terms(model) == sum(len(each.units) for each in model.models)
    assert (count_terms(model) > 0) == (kind == LATENT)
    assert free_run(model, record).outcome


def test_terms_are_those_of_equations_and_the_units_of_state_spaces():
    assert count_terms(make_model()) == 1
    assert count_terms(make_coupled_latent_model()) == 2
    assert count_terms(TWO_MASSES) == 8
    assert count_terms(TWO_MASSES.models[0]) == 4


@pytest.mark.nightly
@pytest.mark.parametrize("kind", [NARX, LATENT])
def test_models_are_estimated_again_on_all_estimation_data(kind):
    u, noise = smooth_input(300, 4), np.random.default_rng(6).standard_normal(300)
    record = Dataset(u, np.convolve(u, 0.2 * 0.8 ** np.arange(40))[:300] + 0.01 * noise, 0.1)
    expected = islands.fit(record, model=kind, refit="all").best
    assert expected.is_refitted
    found = search(kind, record)
    assert found.model == expected.model
    assert found.claimed == expected.metrics["validation"]["free_run"].rmse
    assert found.bands[0].factors == expected.prediction_bands.factors


@pytest.mark.ci
def test_the_linear_model_of_a_linear_system_is_found():
    u, y = smooth_input(1500, 3), np.zeros(1500)
    for k in range(2, 1500):
        y[k] = 1.5 * y[k - 1] - 0.7 * y[k - 2] + 0.2 * u[k - 1]
    noise = 0.01 * np.random.default_rng(5).standard_normal(1500)
    record = Dataset(u, y + noise, 0.1)
    model = find(LINEAR, record)
    assert isinstance(model, LatentModel)
    assert (model.order, model.units) == (2, ())
    assert free_run(model, record).mean_squared_error ** 0.5 == pytest.approx(0.01, rel=0.1)
