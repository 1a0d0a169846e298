"""Preset auto: latent models are chosen where they have more evidence, and are not tried elsewhere."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from islands.facade.automatic import preset_choice
from islands.facade.automatic.choice import Choice, choice_from_document
from islands.facade.automatic.preset_choice import choose_preset
from islands.facade.identify import identify_record
from islands.records.dataset import Dataset
from support.latent_systems import smooth_input

SHORT = {"population": 6, "generations": 2, "migrate_every": 1}


def clipped_record(samples=900, noise=0.003):
    """Return a record of two lags, a saturation and two lags, with noise of the output."""
    u, x, y = 1.5 * smooth_input(samples, 4), np.zeros(4), np.empty(samples)
    for k in range(samples):
        y[k] = x[3]
        between = np.clip(x[1], -0.5, 0.5)
        x = np.array(
            [
                0.8 * x[0] + 0.2 * u[k],
                0.7 * x[1] + 0.3 * x[0],
                0.9 * x[2] + 0.1 * between,
                0.6 * x[3] + 0.4 * x[2],
            ]
        )
    y += noise * np.abs(y).max() * np.random.default_rng(5).standard_normal(samples)
    return Dataset(u, y, 0.01, ("u_V",), "y_V")


def lag_record(noise_of_output, samples=300):
    """Return a record of a lag, which a NARX model describes, with noise of the output or of the equation."""
    u, noise = smooth_input(samples, 2), 0.02 * np.random.default_rng(1).standard_normal(samples)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.8 * y[k - 1] + 0.2 * u[k - 1] + (0.0 if noise_of_output else noise[k])
    return Dataset(u, y + noise if noise_of_output else y, 0.01, ("u_V",), "y_V")


@pytest.fixture
def tried(monkeypatch):
    """Return the choices that are compared with latent models; kinds and latent models are not searched."""
    found = []

    def choose(_record, _split, libraries, *_others):
        kind = next(iter(libraries))
        front = SimpleNamespace(found=SimpleNamespace(models=()))
        return Choice(kind, (), ("", ""), {}, {}, {}), front

    def compare(_record, _front, choice, *_others):
        found.append(choice.kind)
        return choice, []

    monkeypatch.setattr(preset_choice, "choose_kind", choose)
    monkeypatch.setattr(preset_choice, "compare_latent", compare)
    return found


@pytest.mark.nightly
def test_a_saturation_between_lags_is_latent():
    record, messages = clipped_record(), []
    choice = choose_preset(record, 0.25, {}, lambda message, _=None: messages.append(message), lambda: False)
    assert choice.kind == "latent"
    assert choice.errors["latent"] < min(error for kind, error in choice.errors.items() if kind != "latent")
    # The steps of the trial are those of the choice, not of the search.
    trial = "preset auto: trial of latent models"
    assert any(each.startswith(f"{trial}, ") for each in messages)
    assert all(each.startswith(trial) for each in messages[messages.index(trial) :])
    sentence, dead_time = choice.reasons
    assert "Preset auto chose latent (state spaces with static curves)" in sentence
    assert dead_time == "Dead times are those of the linear model, or states."
    found = identify_record(record, preset=choice, **SHORT)
    assert found.settings["choice"]["kind"] == "latent"
    assert choice_from_document(found.settings["choice"]) == replace(choice, models=())
    assert any(each.model.units for each in found.models)


@pytest.mark.nightly
@pytest.mark.parametrize("noise_of_output", [True, False])
def test_a_law_of_narx_models_keeps_its_kind(noise_of_output):
    choice = choose_preset(lag_record(noise_of_output), 0.25, {})
    assert choice.kind == "smooth"
    # The residual of the free run is white with noise of the output, so that latent models are not tried.
    assert ("latent" in choice.errors) == (not noise_of_output)


@pytest.mark.parametrize(
    ("changes", "count"),
    [
        ({}, 1),
        ({"generations": 5}, 1),
        ({"max_terms": 4}, 0),
        ({"library_delays": (1,)}, 0),
        # Models of hysteresis keep a property that latent models do not have.
        ({"constraints": "hysteresis"}, 0),
    ],
)
def test_settings_of_narx_models_exclude_latent_models(tried, changes, count):
    choose_preset(lag_record(True), 0.25, changes)
    assert tried == ["smooth"] * count
