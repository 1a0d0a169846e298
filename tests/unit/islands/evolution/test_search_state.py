"""State of a search: counts, and a history without repeated points."""

from math import inf

from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import StepInfo, empty_archipelago
from islands.evolution.engine import ArchipelagoEpoch
from islands.evolution.search_state import SearchState, advance

#: Best errors of two islands at every generation; infinite if an island has no model yet.
ERRORS = st.sampled_from([1.0, 2.0, inf])
EPOCHS = st.lists(st.lists(st.tuples(ERRORS, ERRORS), min_size=1, max_size=4), min_size=1, max_size=6)


def step(generation, error):
    best = {} if error == inf else {2: error}
    return StepInfo(generation, 10, 3, {"ok": 10}, best)


def states(epochs):
    """Yield the state after every epoch."""
    state, generation = SearchState(empty_archipelago(2, 0)), 0
    for epoch in epochs:
        steps = tuple(
            tuple(step(generation + at, pair[island]) for at, pair in enumerate(epoch)) for island in (0, 1)
        )
        generation += len(epoch)
        state = advance(state, ArchipelagoEpoch(empty_archipelago(2, 0), steps, {}))
        yield state


def complete(epochs):
    pairs = [pair for epoch in epochs for pair in epoch]
    return [(generation, 20 * (generation + 1), pair) for generation, pair in enumerate(pairs)]


@given(EPOCHS)
def test_history_keeps_the_first_and_last_of_equal_consecutive_points(epochs):
    whole = complete(epochs)
    kept = [
        point
        for at, point in enumerate(whole)
        if at in (0, len(whole) - 1) or not whole[at - 1][2] == point[2] == whole[at + 1][2]
    ]
    *_, last = states(epochs)
    assert [(point.generation, point.evaluations, point.islands) for point in last.history] == kept


@given(EPOCHS)
def test_history_does_not_depend_on_the_division_into_epochs(epochs):
    *_, cut = states(epochs)
    *_, whole = states([[pair for epoch in epochs for pair in epoch]])
    assert cut.history == whole.history
