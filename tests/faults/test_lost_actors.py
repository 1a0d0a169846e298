"""Islands whose processes are killed: the result is that of a run that nobody disturbed, bit for bit."""

from contextlib import suppress
from dataclasses import replace
from threading import Event, Thread

import pytest
from processes import actors, eventually, kill
from searches import SMALL, exactly, record

from islands.evolution.archipelago import founded
from islands.evolution.engine import SerialEngine
from islands.evolution.problem import Problem
from islands_service.engines import ENGINES
from islands_service.runtime.cluster import ClusterError

pytestmark = pytest.mark.xdist_group("ray")

SETTINGS = replace(
    SMALL, islands=3, generations=8, migrate_every=1, migrants=2, topology="bidirectional-ring"
)
SEED = 5


def never():
    return False


@pytest.fixture(scope="module")
def posed():
    return Problem(record(), SETTINGS)


@pytest.fixture(scope="module")
def undisturbed(posed):
    return [exactly(epoch.archipelago) for epoch in SerialEngine().run(posed, founded(3, SEED), never)]


@pytest.fixture
def told():
    return []


@pytest.fixture
def engine(told):
    with ENGINES["ray"](None, told.append) as started:
        yield started


def test_an_island_killed_three_times_changes_nothing(posed, undisturbed, engine, told):
    found = []
    for epoch in engine.run(posed, founded(3, SEED), never):
        found.append(exactly(epoch.archipelago))
        if len(found) in (2, 4, 6):
            kill(eventually(actors)[0])
            # Nothing has been asked of the engine since: the loss is before what comes next.
    assert found == undisturbed
    assert told.count("an actor was lost: its islands go on from their last epoch") == 3


def test_losing_all_actors_at_once_changes_nothing(posed, undisturbed, engine, told):
    found = []
    for epoch in engine.run(posed, founded(3, SEED), never):
        found.append(exactly(epoch.archipelago))
        if len(found) == 3:
            for pid in actors():
                kill(pid)
    assert found == undisturbed
    assert len(told) >= 2


@pytest.mark.slow
def test_actors_that_die_again_and_again_end_the_search_with_advice(posed, engine):
    """Too little memory, for example: nobody wants that to go on for days."""
    over = Event()

    def murder():
        while not over.wait(0.01):
            for pid in actors():
                with suppress(ProcessLookupError):
                    kill(pid)

    murderer = Thread(target=murder)
    murderer.start()
    try:
        with pytest.raises(ClusterError, match="actors were lost and no epoch got done"):
            list(engine.run(posed, founded(3, SEED), never))
    finally:
        over.set()
        murderer.join()


def test_a_search_that_ends_leaves_no_actor_behind(posed, engine):
    epochs = engine.run(posed, founded(3, SEED), never)
    next(epochs)
    assert actors()
    epochs.close()
    eventually(lambda: not actors())
