"""`islands.identify`: results, seeds, start states and engines."""

from dataclasses import replace

import numpy as np
import pytest

from islands.errors import SettingsError
from islands.estimation.estimate import estimate
from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.search_state import SearchState
from islands.facade.results.model_simulation import SIMULATION_MODES
from islands.persistence.checkpoints import read_checkpoint, write_checkpoint
from islands.records.split import split
from islands.validation.assessment import MODES
from islands.validation.metrics import metrics
from islands.validation.physics import check_physics
from support.identifications import BUDGET, identify, parameters, record

# Contents of a result.


# Seeds and starts.


@pytest.mark.ci
@pytest.mark.parametrize("seed", [0, *(pytest.param(each, marks=pytest.mark.nightly) for each in (1, 3))])
def test_models_without_property_1_do_not_enter_the_hall_of_fame(data, seed):
    """With y(k-2) instead of y(k-1) the cluster sums are met, but two undamped solutions interleave."""
    states = []
    budget = {"preset": "paper-case1", "population": 30, "generations": 2, "max_terms": 4, "shooting": 100}
    short = data[:1500]
    found = identify(short, **budget, seed=seed, on_epoch=lambda state, _settings: states.append(state))
    assert all(fitted.physics.property_1 for fitted in found.models)
    estimation = split(short, 0.25).estimation
    known = [
        estimate(entry.regressors, estimation, "hysteresis", 26).model
        for entry in states[-1].archipelago.hall_of_fame.entries
    ]
    assert len(known) > 5
    assert all(check_physics(model, estimation).property_1 for model in known)


@pytest.mark.ci
def test_equal_seeds_give_equal_bits_and_other_seeds_other_results(data, result):
    again = identify(data, **BUDGET, seed=5)
    assert parameters(again) == parameters(result)
    assert again.search_result.search.history == result.search_result.search.history
    other = identify(data, **BUDGET, seed=6)
    assert other.search_result.search.history != result.search_result.search.history


@pytest.mark.ci
@pytest.mark.parametrize("stop", [2, *(pytest.param(each, marks=pytest.mark.nightly) for each in (0, 4))])
def test_run_from_a_start_state_equals_an_uninterrupted_run(data, result, states, stop, tmp_path):
    write_checkpoint(states[stop].archipelago, tmp_path / "checkpoint.json", {})
    stored = replace(states[stop], archipelago=read_checkpoint(tmp_path / "checkpoint.json")[0])
    resumed = identify(data, **BUDGET, seed=5, start=stored)
    assert parameters(resumed) == parameters(result)
    assert resumed.search_result.search.history == result.search_result.search.history
    assert resumed.search_result.search.evaluations == result.search_result.search.evaluations
    assert resumed.search_result.search.outcomes == result.search_result.search.outcomes
    assert resumed.search_result.search.duplicates == result.search_result.search.duplicates
    assert resumed.search_result.search.ended_by == result.search_result.search.ended_by


@pytest.mark.parametrize(
    "other",
    [
        empty_archipelago(1, 5),
        empty_archipelago(3, 5),
        empty_archipelago(2, 6),
        Archipelago(),
        Archipelago(empty_archipelago(2, 5).islands[::-1]),
        Archipelago(empty_archipelago(3, 5).islands[1:]),
        Archipelago((empty_archipelago(2, 5).islands[0], empty_archipelago(2, 6).islands[1])),
    ],
)
def test_start_with_other_islands_or_another_seed_raises_an_error(data, other):
    with pytest.raises(SettingsError, match="the start state has other islands or another seed"):
        identify(data, **BUDGET, islands=2, seed=5, start=SearchState(other), on_epoch=pytest.fail)


def test_simulations_of_the_parts_have_the_reported_errors(result):
    split = result.search_result.split
    assert max(fitted.model.maximum_lag for fitted in result.models) < result.best.warm_up
    for fitted in result.models:
        for part, data in (("estimation", split.estimation), ("validation", split.validation)):
            for name, mode in zip(MODES, SIMULATION_MODES, strict=True):
                assert metrics(data.y, fitted.simulate(data, mode).y) == fitted.metrics[part][name]
    own = result.best.simulate(split.validation, warm_up=result.best.model.maximum_lag)
    assert np.isnan(own.y).sum() == result.best.model.maximum_lag


# Stages.


@pytest.mark.ci
def test_stages_before_and_after_the_epochs_are_reported_and_have_no_effect():
    small = BUDGET | {"generations": 1, "population": 10, "max_terms": 3, "initial_terms": (1, 3)}
    search = small | {"library_degree": 1, "swap_search": True, "refine": True}
    news = []
    found = identify(
        record(600),
        **search,
        seed=5,
        on_epoch=lambda _state, _settings: news.append("epoch"),
        progress=lambda message, _fraction=None: news.append(message),
    )
    assert parameters(found) == parameters(identify(record(600), **search, seed=5))
    first, last = news.index("epoch"), len(news) - news[::-1].index("epoch")
    assert news[0] == "sampling rate and direct feedthrough"
    assert any(message.startswith("swap search among") for message in news[:first])
    assert set(news[first:last]) == {"epoch"}
    assessment = news.index("assessment of the final models")
    assert all(message.startswith("estimation of the final models of") for message in news[last:assessment])
    assert set(news[assessment + 1 :]) == {"linear model", "prediction bands"}
