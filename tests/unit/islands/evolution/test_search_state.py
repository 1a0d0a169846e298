"""Where a search stands: what is counted, and a history without the stretches in which nothing happens."""

from math import inf

from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import ArchipelagoEpoch
from islands.evolution.island import StepInfo
from islands.evolution.search_state import SearchState, advance

#: Epochs of two islands: the best error of either at every generation; inf has no model yet.
ERRORS = st.sampled_from([1.0, 2.0, inf])
COURSES = st.lists(st.lists(st.tuples(ERRORS, ERRORS), min_size=1, max_size=4), min_size=1, max_size=6)


def step(generation, error):
    best = {} if error == inf else {2: error}
    return StepInfo(generation, 10, 3, {"ok": 10}, best)


def states(course):
    """Yield the state after every epoch of a course."""
    state, generation = SearchState(empty_archipelago(2, 0)), 0
    for epoch in course:
        steps = tuple(
            tuple(step(generation + at, pair[island]) for at, pair in enumerate(epoch)) for island in (0, 1)
        )
        generation += len(epoch)
        state = advance(state, ArchipelagoEpoch(empty_archipelago(2, 0), steps, {}))
        yield state


def complete(course):
    pairs = [pair for epoch in course for pair in epoch]
    return [(generation, 20 * (generation + 1), pair) for generation, pair in enumerate(pairs)]


@given(COURSES)
def test_a_history_keeps_the_first_and_the_last_of_every_stretch_in_which_nothing_changes(course):
    whole = complete(course)
    kept = [
        point
        for at, point in enumerate(whole)
        if at in (0, len(whole) - 1) or not whole[at - 1][2] == point[2] == whole[at + 1][2]
    ]
    *_, last = states(course)
    assert [(point.generation, point.evaluations, point.islands) for point in last.history] == kept


@given(COURSES)
def test_only_the_last_point_of_a_history_is_ever_replaced(course):
    """A store may keep all the others for good."""
    before = ()
    for state in states(course):
        assert state.history[: len(before)] == before
        before = state.history[:-1]


@given(COURSES)
def test_everything_is_counted_whatever_is_kept_of_it(course):
    generations = len(complete(course))
    *_, last = states(course)
    assert last.evaluations == 20 * generations == last.history[-1].evaluations
    assert last.duplicates == 6 * generations
    assert last.outcomes == {"ok": 20 * generations}
    assert last.history[-1].generation == generations - 1


@given(COURSES)
def test_how_a_course_is_cut_into_epochs_makes_no_difference(course):
    *_, cut = states(course)
    *_, whole = states([[pair for epoch in course for pair in epoch]])
    assert cut.history == whole.history
