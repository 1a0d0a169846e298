"""The facade of evolution: settings in, a result out, the same with every engine and after every stop."""

from dataclasses import asdict, replace
from itertools import pairwise

import pytest

from islands.data.split import split
from islands.errors import SettingsError
from islands.estimation.estimate import estimate
from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.presets import resolve_settings
from islands.evolution.search_state import SearchState
from islands.facade.identify import identify
from islands.io.checkpoints import read_checkpoint, write_checkpoint
from islands.model.candidate_library import full_set
from islands.validation.physics import check_physics
from support.identifications import BUDGET, Telling, parameters

# What a result says.


def test_a_result_says_what_the_search_did(result):
    search = result.search_result.search
    assert search.generations == 4
    assert search.evaluations == 5 * 30
    assert sum(search.outcomes.values()) == search.evaluations
    assert 0 < search.duplicates < search.evaluations
    # Who was abandoned has a model: nobody needed to know how good it is.
    assert search.outcomes["abandoned"] > 0
    models = search.outcomes["ok"] + search.outcomes["abandoned"]
    assert search.feasible_share == models / search.evaluations > 0.5
    assert search.wall_s is None
    assert search.ended_by == "generations"


def test_a_result_holds_the_course_of_the_search(result, states):
    history = result.search_result.search.history
    assert [point.generation for point in history] == [0, 1, 2, 3, 4]
    assert [point.evaluations for point in history] == [30, 60, 90, 120, 150]
    for before, behind in pairwise(history):
        assert all(behind.best[size] <= error for size, error in before.best.items())
    assert [state.archipelago.generation for state in states] == [0, 1, 2, 3, 4]
    assert [state.history for state in states] == [history[: count + 1] for count in range(5)]


def test_the_full_set_is_that_of_the_lags_and_degree_of_what_was_found(result, states):
    """Equation (5); and the memory that its matrix would take, eight bytes a number."""
    found = [item for entry in states[-1].archipelago.hall_of_fame.entries for item in entry.regressors]
    lags = max(lag for item in found for _, lag in item.lags)
    full = result.search_result.search.full_set
    assert full["lags"] == lags >= 2
    assert full["degree"] == max(item.degree for item in found) >= 2
    assert full["candidates"] == full_set(full["degree"], lags, lags)
    rows = 2250 - resolve_settings("hysteresis", BUDGET).maximum_lag
    assert full["bytes"] == 8 * rows * full["candidates"]


def test_a_result_holds_every_setting_that_determines_it(result):
    described = dict(result.search_result.settings)
    expected = asdict(resolve_settings("hysteresis", BUDGET))
    assert {name: described[name] for name in expected} == expected
    assert (described["method"], described["preset"], described["islands"]) == ("identify", "hysteresis", 1)
    assert described["validation"] == 0.25
    assert result.search_result.seed == 5
    assert result.search_result.record.samples == 3000


def test_models_come_best_first_one_a_size_and_none_larger_than_asked_for(result):
    sizes = [fitted.model.size for fitted in result.models]
    assert len(set(sizes)) == len(sizes)
    assert max(sizes) <= 5
    errors = [fitted.metrics["validation"]["free_run"].rmse for fitted in result.models]
    assert errors == sorted(errors)
    assert result.best.metrics["validation"]["free_run"].mape < 0.5


def test_every_constrained_model_has_property_1_and_its_uncertainty(result):
    for fitted in result.models:
        assert fitted.physics.property_1
        assert all(error >= 0.0 for error in fitted.model.standard_errors)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_a_model_without_property_1_is_never_the_answer_under_the_constraint(data, seed):
    """The sums alone let it pass: with y(k-2) for y(k-1) two solutions run side by side, none damped."""
    states = []
    budget = {"preset": "paper-case1", "population": 30, "generations": 2, "max_terms": 4, "shooting": 100}
    short = data[:1500]
    found = identify(short, **budget, seed=seed, progress=lambda state, _settings: states.append(state))
    assert all(fitted.physics.property_1 for fitted in found.models)
    estimation = split(short, 0.25).estimation
    known = [
        estimate(entry.regressors, estimation, "hysteresis", 26).model
        for entry in states[-1].archipelago.hall_of_fame.entries
    ]
    assert not all(check_physics(model, estimation).property_1 for model in known)


# Seeds and starts.


def test_the_same_seed_gives_the_same_models_bit_for_bit_and_another_one_others(data, result):
    again = identify(data, **BUDGET, seed=5)
    assert parameters(again) == parameters(result)
    assert again.search_result.search.history == result.search_result.search.history
    other = identify(data, **BUDGET, seed=6)
    assert other.search_result.search.history != result.search_result.search.history


@pytest.mark.parametrize("stop", [0, 2, 4])
def test_a_start_goes_on_as_if_never_stopped(data, result, states, stop, tmp_path):
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
def test_a_start_of_other_islands_or_another_seed_is_refused(data, other):
    with pytest.raises(SettingsError, match="the start has other islands than the settings, or another seed"):
        identify(data, **BUDGET, islands=2, seed=5, start=SearchState(other), progress=pytest.fail)


def test_a_start_of_its_own_islands_that_nobody_lives_on_is_the_beginning(data, result):
    begun = identify(data, **BUDGET, seed=5, start=SearchState(empty_archipelago(1, 5)))
    assert parameters(begun) == parameters(result)
    assert begun.search_result.search.history == result.search_result.search.history


def islands_budget(**changes):
    return {**BUDGET, "population": 12, "generations": 3, "migrants": 3, "emigrants": "random", **changes}


def test_islands_evolve_beside_each_other(data):
    one, three, apart = [], [], []
    for states, changes in (
        (one, {}),
        (three, {"islands": 3}),
        (apart, {"islands": 3, "topology": "isolated"}),
    ):
        budget = islands_budget(**changes)
        result = identify(
            data[:1000], **budget, seed=5, progress=lambda state, _settings, to=states: to.append(state)
        )
        assert result.search_result.settings["islands"] == len(states[0].archipelago.islands)
        assert result.search_result.search.evaluations == 4 * 12 * result.search_result.settings["islands"]
        for state in states:
            for place, island in enumerate(state.archipelago.islands):
                best = min(entry.fitness for entry in island.hall_of_fame.entries)
                assert state.history[-1].islands[place] == best
            assert min(state.history[-1].islands) == min(state.history[-1].best.values())
    # Who receives from nobody evolves as if it were alone; nobody has left before the first epoch's end.
    assert [state.archipelago.islands[0] for state in apart] == [
        state.archipelago.islands[0] for state in one
    ]
    assert [state.archipelago for state in apart[:2]] == [state.archipelago for state in three[:2]]
    assert apart[-1].archipelago != three[-1].archipelago
    resumed = identify(data[:1000], **islands_budget(islands=3), seed=5, start=three[1])
    assert resumed.search_result.search.history == three[-1].history


def test_an_epoch_ends_where_the_schedule_says_and_its_generations_are_all_told(data):
    states, longer = [], []
    for to, every in ((states, 3), (longer, "2,3:1")):
        identify(
            data[:1000],
            **{**islands_budget(), "generations": 4, "migrate_every": every, "seed": 5},
            progress=lambda state, _settings, to=to: to.append(state),
        )
    assert [state.archipelago.generation for state in states] == [0, 3, 4]
    assert [state.archipelago.generation for state in longer] == [0, 2, 3, 4]
    assert [state.history[-1].generation for state in states] == [0, 3, 4]
    assert [state.evaluations // states[0].evaluations for state in states] == [1, 4, 5]
    # A single island does not notice.
    assert states[-1].history == longer[-1].history


def test_another_engine_may_carry_a_search_out(data, result):
    engine = Telling()
    found = identify(data, **BUDGET, seed=5, engine=engine)
    assert parameters(found) == parameters(result)
    infos = [info for epoch in engine.epochs for (info,) in epoch.steps]
    assert len(infos) == 5
    search = found.search_result.search
    assert search.duplicates == sum(info.duplicates for info in infos)
    assert search.outcomes["ok"] == sum(info.outcomes["ok"] for info in infos)
    assert search.caches == engine.epochs[-1].caches
