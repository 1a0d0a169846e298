"""End of an identification: budgets, stop requests, errors."""

from dataclasses import replace
from math import inf, nextafter

import pytest

from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.presets import resolve_settings
from islands.evolution.search_state import HistoryPoint, SearchState, stop_reason
from support.identifications import BUDGET, identify, record_states


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, ""),
        ({"generations": 7}, "generations"),
        ({"generations": 6}, "generations"),
        ({"generations": 8}, ""),
        ({"max_evaluations": 400}, "evaluations"),
        ({"max_evaluations": 399}, "evaluations"),
        ({"max_evaluations": 401}, ""),
        ({"target_error": 0.5}, "target error"),
        ({"target_error": nextafter(0.5, 1.0)}, "target error"),
        ({"target_error": nextafter(0.5, 0.0)}, ""),
        # The squares of these overflow or underflow.
        ({"target_error": 1e200}, "target error"),
        ({"target_error": 1.7976931348623157e308}, "target error"),
        ({"target_error": 1e-200}, ""),
        ({"target_error": 0.5, "max_evaluations": 401}, "target error"),
        ({"target_error": 0.4, "max_evaluations": 400}, "evaluations"),
        ({"target_error": 0.5, "max_evaluations": 400, "generations": 7}, "generations"),
    ],
)
def test_stop_reason_is_the_budget_that_is_used_up(changes, expected):
    """The error is the latest RMSE of the best island, in the unit of the output."""
    archipelago = Archipelago(
        tuple(replace(island, generation=7) for island in empty_archipelago(2, 0).islands)
    )
    history = (HistoryPoint(6, 350, {3: 0.3}, (inf, 0.3)), HistoryPoint(7, 400, {3: 0.25}, (inf, 0.25)))
    state = SearchState(archipelago, 400, history=history)
    assert stop_reason(state, resolve_settings("narx", changes)) == expected


@pytest.mark.parametrize("target", [0.0, 1.0, 1.7976931348623157e308])
def test_search_continues_until_an_island_has_a_model(target):
    settings = resolve_settings("narx", {"target_error": target, "max_evaluations": 1, "generations": 0})
    assert stop_reason(SearchState(empty_archipelago(2, 0)), settings) == ""
    waiting = SearchState(empty_archipelago(2, 0), history=(HistoryPoint(0, 0, {}, (inf, inf)),))
    assert stop_reason(waiting, replace(settings, generations=1)) == ""


def test_epoch_in_which_a_budget_is_reached_is_completed(data, states):
    """A longer run has the same epochs, because no epoch is cut short."""
    seen = []
    changes = {**BUDGET, "migrate_every": 3, "max_evaluations": 31}
    found = identify(data, **changes, seed=5, on_epoch=record_states(seen))
    assert [state.evaluations for state in seen] == [30, 120]
    assert seen[-1].history == states[3].history
    assert (found.search_result.search.generations, found.search_result.search.ended_by) == (3, "evaluations")


def test_stopped_search_keeps_its_last_epoch(data, states):
    seen = []
    found = identify(data, **BUDGET, seed=5, on_epoch=record_states(seen), stop=lambda: len(seen) == 2)
    assert seen == states[:2]
    assert found.search_result.search.ended_by == "stopped"
    assert found.search_result.search.generations == 1
    assert found.search_result.search.history == states[1].history


@pytest.mark.ci
def test_search_stopped_within_an_epoch_keeps_the_previous_epoch(data, states):
    calls = []

    def stop():
        calls.append(True)
        return len(calls) > 6

    seen = []
    found = identify(data, **{**BUDGET, "migrate_every": 4}, seed=5, on_epoch=record_states(seen), stop=stop)
    assert seen == states[:1]
    assert (found.search_result.search.generations, found.search_result.search.ended_by) == (0, "stopped")
    # A resumed run continues as if it had not been stopped.
    resumed = identify(data, **{**BUDGET, "migrate_every": 4}, seed=5, start=seen[-1])
    assert resumed.search_result.search.history == states[-1].history
