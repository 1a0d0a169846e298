"""Islands whose processes are killed: the result is that of a run that nobody disturbed, bit for bit."""

import os
from contextlib import suppress
from dataclasses import replace
from threading import Event, Thread

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.problem import Problem
from islands_service.engines import ENGINES
from islands_service.runtime import actor_pool
from islands_service.runtime.cluster import LOST, ClusterError
from support.processes import actors, alive, eventually, kill
from support.searches import SMALL, exactly, record

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
    return [
        exactly(epoch.archipelago) for epoch in SerialEngine().run(posed, empty_archipelago(3, SEED), never)
    ]


@pytest.fixture
def told():
    return []


@pytest.fixture
def engine(ray_address, told):
    with ENGINES["ray"](ray_address, told.append) as started:
        yield started
    # The next test counts its own actors alone.
    eventually(lambda: not actors())


@pytest.mark.ci
def test_an_island_killed_three_times_changes_nothing(posed, undisturbed, engine, told):
    found = []
    for epoch in engine.run(posed, empty_archipelago(3, SEED), never):
        found.append(exactly(epoch.archipelago))
        if len(found) in (2, 4, 6):
            victim = min(actors())
            kill(victim)
            eventually(lambda pid=victim: not alive([pid]))
            # Nothing has been asked of the engine since: the loss is before what comes next.
    assert found == undisturbed
    assert told.count("an actor was lost: its islands go on from their last epoch") == 3


@pytest.mark.nightly
def test_losing_all_actors_at_once_changes_nothing(posed, undisturbed, engine, told):
    found = []
    for epoch in engine.run(posed, empty_archipelago(3, SEED), never):
        found.append(exactly(epoch.archipelago))
        if len(found) == 3:
            for pid in actors():
                kill(pid)
    assert found == undisturbed
    assert len(told) == min(3, len(os.sched_getaffinity(0)))


@pytest.mark.nightly
def test_in_a_long_search_somebody_stands_in_for_who_is_lost_until_that_is_replaced(
    posed, engine, told, monkeypatch
):
    import ray

    monkeypatch.setattr(actor_pool, "STAND_IN_AFTER", 0.0)
    found = actor_pool.IslandActorPool(posed, 3, told.append)
    try:
        everybody = min(3, len(os.sched_getaffinity(0))) + 1
        eventually(lambda: found.maintain(at_once=True) and len(found.places) == everybody)
        regular = [found.actor_for(island) for island in range(3)]
        kill(min(actors()))
        eventually(lambda: found.maintain(at_once=True) and told)
        assert found.places[0] == actor_pool.STAND_IN
        assert len(found.places) == everybody - 1
        replaced = [
            now for now, before in zip(map(found.actor_for, range(3)), regular, strict=True) if now != before
        ]
        assert replaced
        assert all(now not in regular for now in replaced)
        ray.get([actor.prepare.remote() for actor in replaced])
        eventually(lambda: found.maintain(at_once=True) and len(found.places) == everybody)
        assert not set(replaced) & {found.actor_for(island) for island in range(3)}
    finally:
        found.shutdown()


@pytest.mark.nightly
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
            list(engine.run(posed, empty_archipelago(3, SEED), never))
    finally:
        over.set()
        murderer.join()


@pytest.mark.ci
def test_a_search_that_ends_leaves_no_actor_behind(posed, engine):
    epochs = engine.run(posed, empty_archipelago(3, SEED), never)
    next(epochs)
    assert actors()
    epochs.close()
    eventually(lambda: not actors())


@pytest.mark.parametrize("kind", ["OutOfMemoryError", "NodeDiedError", "ObjectLostError"])
def test_a_loss_is_a_loss_whatever_ray_calls_it(kind):
    """The watchdog of a machine's memory has an error of its own, which is no error of an actor."""
    from ray import exceptions

    assert issubclass(getattr(exceptions, kind), LOST)


@pytest.mark.ci
def test_a_ray_that_is_there_is_left_alone(engine):
    import ray

    with pytest.raises(ClusterError, match="on a Ray already"), ENGINES["ray"](None, print):
        pass
    assert ray.is_initialized()
