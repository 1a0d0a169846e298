"""Properties of an epoch: it equals its steps and ends at a stop."""

from dataclasses import replace

import pytest

from islands.evolution.archipelago import Island
from islands.evolution.engine import receive_migrants, run_epoch, select_migrants
from islands.evolution.evaluation import Evaluator
from islands.evolution.generation import first_generation, step
from islands.evolution.hall_of_fame import HallOfFame
from islands.evolution.problem import GeneEvolution, make_problem
from support.migrations import (
    every_replacement_policy,
    recorded,
    run_next_epoch,
)
from support.searches import SMALL, exactly


@pytest.fixture(scope="module")
def search_problem():
    """Problem with a library, whose seeds are in the first population and whose genes are in the pool."""
    setting = replace(
        SMALL,
        population=12,
        elite=0.5,
        generations=8,
        migrate_every=3,
        library="phi-polynomial",
        library_degree=2,
        from_library=0.5,
        characters=("pruner", "explorer"),
    )
    return make_problem(recorded(), setting)


def run_first_epochs(search_problem, index=0):
    """Return the first three epochs, which end at generations 0, 3 and 6."""
    epochs = [run_next_epoch(Island(index, 7, -1, (), (), HallOfFame()), search_problem)]
    epochs.append(run_next_epoch(epochs[-1].island, search_problem))
    epochs.append(run_next_epoch(epochs[-1].island, search_problem))
    return epochs


@pytest.mark.parametrize("index", [0, 1])
def test_epoch_equals_its_steps(search_problem, index):
    own_evaluator, setting = (
        Evaluator(search_problem.record, search_problem.settings),
        search_problem.settings_of(index),
    )
    initial, first, second = run_first_epochs(search_problem, index)
    island, info = first_generation(index, 7, own_evaluator, search_problem.seeds, setting)
    assert exactly(initial.island) == exactly(island)
    assert (initial.steps, initial.emigrants) == ((info,), ())
    for epoch in (first, second):
        infos = []
        for _ in range(3):
            island, info = step(island, own_evaluator, search_problem.pool, setting)
            infos.append(info)
        assert exactly(epoch.island) == exactly(island)
        assert epoch.steps == tuple(infos)
        assert epoch.emigrants == select_migrants(island, setting)
        assert len(epoch.emigrants) == 1


@every_replacement_policy
def test_epoch_begins_with_immigration(search_problem, replaced):
    search_problem = replace(
        search_problem, settings=replace(search_problem.settings, replaced=replaced, migrants=6)
    )
    here, there = run_first_epochs(search_problem, 0)[1], run_first_epochs(search_problem, 1)[1]
    own_evaluator = Evaluator(search_problem.record, search_problem.settings)
    after_immigration = receive_migrants(here.island, [there.emigrants], search_problem.open())
    assert after_immigration != here.island
    after = run_next_epoch(here.island, search_problem, [there.emigrants])
    infos = []
    for _ in range(3):
        after_immigration, info = step(
            after_immigration, own_evaluator, search_problem.pool, search_problem.settings_of(0)
        )
        infos.append(info)
    assert exactly(after.island) == exactly(after_immigration)
    assert after.steps == tuple(infos)
    assert after.island != run_next_epoch(here.island, search_problem).island


def test_epochs_without_immigrants_compose(search_problem):
    """Two epochs of three generations equal one of six, so a stop alone has no effect."""
    initial, first, second = run_first_epochs(search_problem)
    longer = replace(search_problem, settings=replace(search_problem.settings, migrate_every=6))
    whole = run_next_epoch(initial.island, longer)
    assert exactly(whole.island) == exactly(second.island)
    assert whole.steps == first.steps + second.steps
    assert whole.emigrants == second.emigrants


@pytest.mark.parametrize("calls", [1, 2, 3])
def test_stopped_epoch_returns_none(search_problem, calls):
    initial, first, _ = run_first_epochs(search_problem)
    own_evaluator, answers = (
        Evaluator(search_problem.record, search_problem.settings),
        iter([False] * (calls - 1) + [True]),
    )
    assert (
        run_epoch(initial.island, [], GeneEvolution(search_problem, own_evaluator), lambda: next(answers))
        is None
    )
    assert list(answers) == []
    # The unfinished epoch is discarded and does not affect later epochs.
    assert exactly(
        run_next_epoch(initial.island, search_problem, evaluator_of_run=own_evaluator).island
    ) == exactly(first.island)
