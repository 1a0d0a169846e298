"""Identification of latent models: the structure of the system, the same result every time."""

from dataclasses import replace

import numpy as np
import pytest

import islands
from islands.errors import RecordError, SettingsError
from islands.evolution.presets import resolve_settings
from islands.facade.identify import identify_record
from islands.progress import StoppedError
from islands.records.dataset import Dataset
from islands.simulation.predictors import free_run
from support.latent_systems import smooth_input, spring_record

#: A search that takes a second.
SHORT = {"population": 8, "generations": 4, "migrate_every": 2, "islands": 2}


def identify(record, **changes):
    return identify_record(record, preset="latent", **{**SHORT, **changes})


def rmse(model, record):
    run = free_run(model, record, 100)
    return float(np.sqrt(np.mean((run.y - record.y)[100:] ** 2)))


def saturated_record(samples, seed, *, output=False):
    """Return a record of two lags behind a saturation of the input, or before one, with noise of 0.01."""
    u, x, y = 1.5 * smooth_input(samples, seed), np.zeros(2), np.empty(samples)
    for k in range(samples):
        y[k] = np.tanh(x[0]) if output else x[0]
        moved = u[k] if output else np.clip(u[k], -1.0, 1.0)
        x = np.array([0.9 * x[0] + 0.2 * x[1], 0.7 * x[1] + 0.3 * moved])
    return Dataset(u, y + 0.01 * np.random.default_rng(seed + 50).standard_normal(samples), 0.01)


@pytest.fixture(scope="module")
def result():
    return identify(spring_record(400, noise=0.02))


@pytest.mark.ci
def test_modes_have_standard_errors(result, tmp_path):
    for each in result.models:
        assert len(each.model.quantity_errors) == len(each.model.quantities)
    result.save(tmp_path, figures=())
    saved = islands.load(tmp_path)
    assert saved.best.model == result.best.model
    errors = [each["standard_error"] for each in saved.best.document["quantities"]]
    assert tuple(errors) == result.best.model.quantity_errors


@pytest.mark.ci
def test_a_refit_leaves_out_a_limit_that_the_validation_data_exceed():
    record = spring_record(800, noise=0.02)
    y = record.y.copy()
    y[:600] = np.maximum(y[:600], -0.3)
    settings = {"population": 4, "generations": 1, "islands": 1, "validation": 0.25}
    found = [identify(replace(record, y=y), refit=each, **settings).best.model for each in ("none", "all")]
    assert [each.limits.lower for each in found] == [-0.3, None]


@pytest.mark.nightly
def test_a_saturation_of_the_input_is_found():
    best = identify_record(saturated_record(1200, 1), preset="latent").best.model
    assert rmse(best, saturated_record(1500, 7)) == pytest.approx(0.01, rel=0.15)


@pytest.mark.ci
def test_a_search_that_continues_has_the_same_result(result):
    states = []
    identify(spring_record(400, noise=0.02), on_epoch=lambda state, _settings: states.append(state))
    assert [state.archipelago.generation for state in states] == [0, 2, 4]
    continued = identify(spring_record(400, noise=0.02), start=states[1])
    assert [each.model for each in continued.models] == [each.model for each in result.models]
    with pytest.raises(SettingsError, match="another seed"):
        identify(spring_record(400, noise=0.02), start=states[1], seed=1)


@pytest.mark.ci
@pytest.mark.parametrize(("structure", "absent"), [("wiener", "e"), ("hammerstein", "w"), ("feedback", "f")])
def test_a_structure_has_its_zeros(structure, absent):
    found = identify(saturated_record(400, 1, output=structure == "wiener"), structure=structure)
    assert any(each.model.units for each in found.models)
    for each in found.models:
        assert not any(name.startswith(absent) for name in each.model.names)
        assert np.isfinite(rmse(each.model, saturated_record(300, 7)))


@pytest.mark.ci
def test_a_stop_keeps_the_models_so_far():
    epochs = []
    found = identify(
        spring_record(400, noise=0.02),
        on_epoch=lambda state, _settings: epochs.append(state),
        stop=lambda: bool(epochs),
    )
    assert found.models
    assert all(np.isfinite(each.model.parameters).all() for each in found.models)
    assert found.search_result.search.ended_by == "stopped"
    with pytest.raises(StoppedError):
        identify(spring_record(400, noise=0.02), stop=lambda: True)


@pytest.mark.nightly
def test_units_of_the_record_do_not_matter():
    record = spring_record(400, noise=0.02)
    scaled = replace(record, u=1e3 * record.u + 5.0, y=1e-6 * record.y - 2.0)
    models = [identify(each).models[0].model for each in (record, scaled)]
    runs = [free_run(each, data, 60).y[60:] for each, data in zip(models, (record, scaled), strict=True)]
    assert runs[1] == pytest.approx(1e-6 * runs[0] - 2.0, abs=1e-10)


@pytest.mark.ci
def test_a_record_that_is_too_short_has_no_models():
    with pytest.raises(RecordError, match="take a longer recording"):
        identify(spring_record(16))


def test_settings_of_narx_models_are_refused():
    with pytest.raises(
        SettingsError, match="max_terms is a setting of NARX models, not of the preset latent"
    ):
        resolve_settings("latent", {"max_terms": 3})
    with pytest.raises(SettingsError, match="unknown structure of latent models 'phi'"):
        resolve_settings("latent", {"structure": "phi"})
    with pytest.raises(SettingsError, match="the preset narx searches narx models: leave model_class out"):
        resolve_settings("narx", {"model_class": "latent", "structure": "auto"})
