"""Estimation of the ranked models on estimation and validation data together."""

import json
from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.errors import SettingsError
from islands.estimation.estimator_table import ESTIMATORS
from islands.facade.refit import join_data
from islands.persistence.models import read_validated_model
from islands.records.dataset import Dataset
from islands.report.figures.registry import FIGURES
from islands.report.text.facts import BEFORE_REFIT, ResultFacts
from islands.report.text.statements import describe
from islands.sentences import write_one
from islands.simulation.initial_outputs import simulate_freely
from islands.validation.metrics import metrics
from support.noisy_records import TERMS, make_noisy_record

pytestmark = pytest.mark.ci

LAW = {"library": "polynomial", "degree": 2, "lags": 1, "max_terms": 3, "average": 1, "certificate": 0}


def fit_law(record, refit="all", **changes):
    return islands.fit(record, refit=refit, **{**LAW, **changes})


def find_law(result):
    return next(each for each in result.models if tuple(each.model.equation().terms) == TERMS)


@pytest.mark.parametrize("estimator", ["", *ESTIMATORS])
def test_a_refit_changes_neither_the_ranking_nor_any_error(estimator):
    record = make_noisy_record("output", 1, 400)
    without, found = (fit_law(record, refit, estimator=estimator, shooting=40) for refit in ("none", "all"))
    assert [each.model for each in without.models] == [each.assessment.model for each in found.models]
    assert [each.metrics for each in without.models] == [each.metrics for each in found.models]
    assert found.recommendation.rank == without.recommendation.rank
    assert found.best.prediction_bands.factors == without.best.prediction_bands.factors
    assert found.best.is_refitted
    assert not without.best.is_refitted
    assert found.best.model.parameter_names == without.best.model.parameter_names
    assert found.best.model != without.best.model


def test_least_squares_of_all_samples_are_the_parameters_of_a_refit():
    record = make_noisy_record("equation", 3, 400)
    found = find_law(fit_law(record, estimator="least-squares"))
    y, u = record.y, record.u[:, 0]
    columns = np.array([y[:-1], u[:-1], y[:-1] * u[:-1]])
    expected = np.linalg.lstsq(columns.T, y[1:], rcond=None)[0]
    np.testing.assert_allclose(found.model.theta, expected, rtol=1e-9)


def test_parameters_that_increase_the_error_on_all_data_are_discarded():
    record = make_noisy_record("output", 4, 300)
    result = fit_law(record, lags=2, max_terms=6, estimator="least-squares")
    states = set()
    for each in result.models:
        refit, warm_up = each.assessment.refit, each.warm_up
        runs = [simulate_freely(model, record, warm_up) for model in (each.assessment.model, each.model)]
        before, after = (run.mean_squared_error**0.5 for run in runs)
        states.add(bool(refit.discarded))
        if refit.discarded:
            assert each.model == each.assessment.model
            assert not each.is_refitted
            assert "the free-run RMSE on all data would increase" in refit.discarded
        else:
            assert after <= 1.05 * before
    assert states == {True, False}


@pytest.mark.parametrize("statements", ["fixed-point = 0, 0; gain = 3", "[u(k-1)] >= 0; gain = 3"])
def test_constraints_hold_after_a_refit(statements):
    record = make_noisy_record("output", 4, 400, 0.02)
    result = fit_law(record, constraints=statements)
    refitted = [each for each in result.models if each.is_refitted]
    assert refitted
    for each in refitted:
        assert each.model != each.assessment.model
        assert all(check.met for check in each.constraints)
        assert [check.value for check in each.constraints if "gain" in check.text] == [pytest.approx(3.0)]


@pytest.mark.nightly
def test_latent_models_keep_their_wiring_and_reduce_the_error_on_all_data():
    rng = np.random.default_rng(0)
    u, y = np.repeat(rng.uniform(0.2, 1.0, 60), 10), np.zeros(600)
    for k in range(1, 600):
        y[k] = 0.95 * y[k - 1] + 0.05 * u[k - 1] ** 2
    record = Dataset(u, y + 0.01 * rng.standard_normal(600), 0.1)
    best = islands.fit(record, model="latent", refit="all").best
    assert best.is_refitted
    before = best.assessment.model
    assert best.model.wiring == before.wiring
    data = islands.records.compatibility.match_record(before, record)
    errors = [simulate_freely(each, data).mean_squared_error for each in (before, best.model)]
    assert errors[1] < errors[0]


def test_the_linear_model_is_estimated_again_on_all_data():
    rng = np.random.default_rng(6)
    u, x = rng.uniform(-1.0, 1.0, 600), np.zeros(600)
    for k in range(2, 600):
        x[k] = 1.5 * x[k - 1] - 0.56 * x[k - 2] + 0.3 * u[k - 1]
    record = Dataset(u, x + 0.02 * rng.standard_normal(600), 1.0)
    linear = islands.fit(record, library="polynomial", degree=1, max_terms=3, refit="all")
    (entry,) = (each for each in linear.search_result.models if each.model.kind == "latent")
    assert entry.refit.samples == 600
    assert not entry.refit.discarded
    errors = [simulate_freely(each, record).mean_squared_error for each in (entry.model, entry.final_model)]
    assert errors[1] < errors[0]


def test_a_fraction_is_joined_with_the_record_and_another_record_is_not():
    record = make_noisy_record("equation", 7, 100)
    assert join_data(record, 0.25) is record
    other = replace(make_noisy_record("equation", 8, 50), input_names=("u_val",))
    joined = join_data(replace(record, input_names=("u_est",)), other)
    assert joined.segments == (100, 50)
    assert joined.input_names == ("u_est",)
    y = record.y.copy()
    y[40:45] = np.nan
    assert join_data(replace(record, y=y), 0.25).segments == (40, 55)


def test_a_refit_uses_means_and_advanced_inputs_as_the_model_does():
    record = make_noisy_record("output", 9, 1200)
    for changes, samples in (({"average": 4}, 300), ({"feedthrough": "yes"}, 1200)):
        entry = fit_law(record, estimator="free-run", **changes).best.assessment
        assert entry.refit.samples == samples
        assert not entry.refit.discarded


def test_a_document_has_the_model_whose_errors_it_states(tmp_path):
    record = make_noisy_record("output", 10, 400)
    result = fit_law(record)
    result.save(tmp_path, figures=())
    document = json.loads((tmp_path / "result.json").read_text())
    entry = document["models"][result.best.rank - 1]
    assert entry["refit"]["samples"] == 400
    saved = islands.load(tmp_path).best
    assert saved.is_refitted
    assert saved.model == result.best.model
    validated = read_validated_model(entry, saved.model)
    assert validated == result.best.assessment.model
    data = result.search_result.split.validation
    run = simulate_freely(validated, data, saved.warm_up)
    assert metrics(data.y, run.y) == saved.metrics["validation"]["free_run"]
    for each in (saved, result.best):
        assert each.describe_errors()[-1].endswith(BEFORE_REFIT)
    assert BEFORE_REFIT in write_one("result", "headline", f=ResultFacts(document))
    assert "estimated again on all 400 samples" in " ".join(describe(document))


def test_figures_on_the_validation_data_show_the_model_of_the_errors():
    result = fit_law(make_noisy_record("output", 11, 400, 0.2))
    split, entry = result.search_result.split, result.best.assessment
    before = simulate_freely(entry.model, split.validation, result.best.warm_up).y
    assert not np.array_equal(before, result.best.simulate(split.validation).y, equal_nan=True)
    panels = (FIGURES["free-run"](entry, split).axes[0], result.best.plot("free-run").axes[0])
    for panel in (*panels, result.best.plot("free-run", ax=panels[0]).axes[0]):
        drawn = [np.asarray(line.get_ydata()) for line in panel.get_lines()]
        assert any(np.array_equal(each[-300:], before[-len(each) :][-300:], equal_nan=True) for each in drawn)


def test_a_refit_is_all_or_none_and_of_one_output():
    record = make_noisy_record("output", 13, 200)
    with pytest.raises(SettingsError, match="refit is one of none, all, got 'every'"):
        fit_law(record, "every")
    with pytest.raises(SettingsError, match="refit is one of none, all"):
        islands.identify(record, preset="narx", refit="every")
    frame = {"u": record.u[:, 0], "y": record.y, "z": record.y}
    with pytest.raises(SettingsError, match="refit is 'none' with several outputs"):
        islands.fit(frame, inputs="u", output=("y", "z"), dt=1.0, refit="all")
