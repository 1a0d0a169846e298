"""Choice of the preset auto: the kind of a record, its dead times, and precedence of explicit settings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import islands
from islands.evolution.presets import resolve_kind
from islands.facade.automatic.choice import choice_from_document
from islands.facade.automatic.kind_choice import _select_kind, measure_share
from islands.facade.automatic.preset_choice import choose_preset, fit_chosen_library
from islands.facade.fit_settings import FitSettings
from islands.models.form import name_form
from islands.progress import ignore_progress, never_stop
from islands.records.dataset import Dataset
from islands.records.split import split
from support.assessments import with_changes
from support.known_records import runaway
from support.portfolio_records import KINDS as RECORDS


def record(kind, samples=600):
    return replace(RECORDS[kind], samples=samples).record(1)[0]


def choose(data, delays=None):
    """Return the choice of `fit`, and its result."""
    settings = FitSettings(degree=2, delays=delays, certificate=0)
    result = fit_chosen_library(data, split(data), settings, 0, ignore_progress, never_stop).complete()
    return choice_from_document(result.settings["choice"]), result


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("first order", "smooth"),
        pytest.param("Coulomb friction", "friction", marks=pytest.mark.nightly),
        pytest.param("tank", "magnitude", marks=pytest.mark.nightly),
        ("Bouc-Wen", "hysteresis"),
    ],
)
@pytest.mark.ci
def test_record_gets_the_library_of_its_kind(name, kind):
    choice, result = choose(record(name, 1000))
    assert choice.kind == kind
    assert result.settings["library"] == resolve_kind(kind, (), {}).library
    compared = choice.errors or choice.trials
    assert compared[kind] <= 1.15 * min(compared.values())


@pytest.mark.ci
def test_the_front_begins_with_the_linear_model_and_only_grows():
    data, fronts = record("tank", 400), []
    settings = FitSettings(degree=2, certificate=0)
    fit_chosen_library(data, split(data), settings, 0, ignore_progress, never_stop, fronts.append)
    assert [name_form(each.model) for each in fronts[0].models] == ["linear"]
    assert len(fronts) >= 3
    least = [min(each.mean_square for each in front.models) for front in fronts]
    assert least == sorted(least, reverse=True)


@pytest.mark.nightly
def test_dead_time_is_added_to_the_lags():
    choice, result = choose(record("dead time"))
    assert choice.delays == result.settings["delays"] == (7,)
    assert "dead time of 7 samples" in choice.reasons[1]
    given, result = choose(record("dead time"), delays=[0])
    assert not any(given.delays)
    assert not any(result.settings["delays"])
    assert given.trials["smooth"] > 10.0 * choice.trials["smooth"]


@pytest.mark.ci
def test_a_dead_time_that_the_record_does_not_have_is_refused(monkeypatch):
    """The trials refuse a dead time that the linear model takes for one."""
    monkeypatch.setattr("islands.facade.automatic.kind_choice.find_delays", lambda _: (20,))
    choice, result = choose(record("first order", 300))
    assert choice.delays == tuple(result.settings["delays"]) == ()


def test_record_that_is_too_short_gets_the_simplest_kind():
    choice = choose_preset(record("first order", 10), 0.25, {})
    assert choice.kind == "smooth"
    assert "too short" in choice.reasons[0]


@pytest.mark.ci
def test_a_slow_room_is_linear_and_has_its_gains():
    """A room of 25 hours: a model of means had the smaller error, because means contain less noise."""
    rng = np.random.default_rng(102)
    heating, level = np.zeros(2400), 0.0
    for k in range(2400):
        if rng.random() < 0.01:
            level = rng.choice([0.0, 1.0])
        heating[k] = level
    outside = 4.0 * np.sin(2.0 * np.pi * np.arange(2400) / 144.0 + rng.random())
    outside += 0.05 * np.cumsum(rng.standard_normal(2400))
    y, pole = np.zeros(2400), np.exp(-1.0 / 150.0)
    for k in range(1, 2400):
        y[k] = pole * y[k - 1] + (1.0 - pole) * (8.0 * heating[k - 1] + outside[k - 1])
    measured = np.round(y + 0.05 * rng.standard_normal(2400), 1)
    choice, result = choose(Dataset(np.column_stack([heating, outside]), measured, 600.0))
    assert choice.kind == "smooth"
    assert name_form(result.recommended.model) == "linear"
    system = islands.linearise(result.recommended.model)
    assert system.poles == pytest.approx([pole], abs=5e-4)
    assert system.static_gain[0] == pytest.approx([8.0, 1.0], rel=0.1)


@pytest.mark.ci
def test_the_reason_for_a_kind_names_a_better_one_that_is_left_out():
    data = runaway(600, 0, 0.003)
    options = {"degree": 2, "lags": 1, "max_terms": 5, "average": 1, "certificate": 0}
    found = islands.fit(data, library="polynomial", **options).search_result
    law, larger = (next(each for each in found.models if each.model.size == size) for size in (4, 5))
    bounded = next(each for each in found.models if each.model.size == 2).physics
    models = {"smooth": law, "magnitude": with_changes(larger, physics=bounded)}
    errors = {kind: measure_share(each, data) for kind, each in models.items()}
    libraries = dict.fromkeys(models, SimpleNamespace(constraints="none"))
    kind, reason = _select_kind(data, libraries, None, models, errors, ())
    assert kind == "magnitude"
    assert "; left out: smooth with a divergence at inputs held at 0.8 times their" in reason
    kind, reason = _select_kind(data, libraries, None, models | {"magnitude": larger}, errors, ())
    assert kind == "smooth"
    assert "left out" not in reason


@pytest.mark.ci
def test_a_level_that_integrates_is_not_taken_for_hysteresis():
    """It rests at the balance of its inputs, and a constant is the best trial of the last samples."""
    pump = np.ones(400)
    pump[50:180], pump[300:] = 1.2, 0.9
    level = 30.0 + np.append(0.0, np.cumsum(0.18 * (pump[:-1] - 1.0)))
    data = Dataset(pump, level + 0.03 * np.random.default_rng(1).standard_normal(400), 60.0)
    choice, result = choose(data)
    assert min(choice.trials, key=choice.trials.__getitem__) == "hysteresis" != choice.kind
    assert name_form(result.recommended.model) == "linear"
    assert result.recommended.validation_error < 0.04


@pytest.mark.ci
def test_a_stop_after_the_linear_model_keeps_it():
    """It is the first model, before the kinds are tried."""
    messages = []
    trying = "preset auto: trial of smooth"
    found = islands.fit(
        record("first order", 300),
        progress=lambda message, _=None: messages.append(message),
        stop=lambda: trying in messages,
    )
    assert [each.model.kind for each in found.models] == ["latent"]
    assert found.search_result.search.ended_by == "stopped"
    assert "choice of the kind of record" in found.left_out
