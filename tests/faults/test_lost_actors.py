"""Killed actors: the result equals that of an undisturbed run, bit for bit."""

import os
import signal
import time
from contextlib import suppress
from dataclasses import replace
from threading import Event, Thread

import pytest

from islands.available_cpus import count_cpus
from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.latent_problem import make_latent_problem
from islands.evolution.presets import resolve_settings
from islands.evolution.problem import Problem
from islands.progress import Steps
from islands_service.engines import ENGINES
from islands_service.runtime import actor_pool
from islands_service.runtime.cluster import ClusterError
from islands_service.runtime.ray_engine import RayEngine
from support.latent_systems import spring_record
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
def messages():
    return []


@pytest.fixture
def engine(ray_address, messages):
    with ENGINES["ray"](ray_address, messages.append) as started:
        yield started
    # The next test counts only its own actors.
    eventually(lambda: not actors())


@pytest.mark.ci
def test_three_killed_actors_do_not_change_the_result(posed, undisturbed, engine, messages):
    found = []
    for epoch in engine.run(posed, empty_archipelago(3, SEED), never):
        found.append(exactly(epoch.archipelago))
        if len(found) in (2, 4, 6):
            victim = min(eventually(actors))
            kill(victim)
            eventually(lambda pid=victim: not alive([pid]))
            # The engine is suspended: the loss occurs before the next step.
    assert found == undisturbed
    assert messages.count("an actor was lost: its islands continue from their last epoch") == 3


@pytest.mark.ci
def test_killed_actors_do_not_change_a_search_for_latent_models(ray_address, messages):
    changes = {"population": 6, "generations": 6, "islands": 2, "migrate_every": 1}
    settings = resolve_settings("latent", changes)
    problem = make_latent_problem(spring_record(240, noise=0.02), settings, Steps())
    alone = [each.archipelago for each in SerialEngine().run(problem, empty_archipelago(2, SEED), never)]
    found = []
    with ENGINES["ray"](ray_address, messages.append) as engine:
        for epoch in engine.run(problem, empty_archipelago(2, SEED), never):
            found.append(exactly(epoch.archipelago))
            if len(found) in (2, 4):
                victim = min(eventually(actors))
                kill(victim)
                eventually(lambda pid=victim: not alive([pid]))
    assert found == [exactly(each) for each in alone]
    assert messages.count("an actor was lost: its islands continue from their last epoch") == 2
    assert alone[-1].find_front()[-1].units
    eventually(lambda: not actors())


@pytest.mark.nightly
def test_frozen_actor_is_replaced_and_does_not_change_the_result(posed, undisturbed, engine, messages):
    """The three islands share two actors: a frozen one has a queue, and the other waits for its emigrants."""
    found, frozen = [], 0
    for epoch in engine.run(posed, empty_archipelago(3, SEED), never):
        found.append(exactly(epoch.archipelago))
        if len(found) == 3:
            frozen = min(eventually(actors))
            os.kill(frozen, signal.SIGSTOP)
            began = time.monotonic()
    assert found == undisturbed
    # Less than a minute also on a busy machine: without a deadline, it would last until Ray gives up.
    assert time.monotonic() - began < 60.0
    assert any("did not answer" in message for message in messages)
    eventually(lambda: not alive([frozen]))


@pytest.mark.nightly
def test_loss_of_all_actors_does_not_change_the_result(posed, undisturbed, engine, messages):
    found = []
    for epoch in engine.run(posed, empty_archipelago(3, SEED), never):
        found.append(exactly(epoch.archipelago))
        if len(found) == 3:
            for pid in actors():
                kill(pid)
    assert found == undisturbed
    assert sum("was lost" in message for message in messages) == min(3, count_cpus())


@pytest.mark.nightly
def test_standby_actor_replaces_a_lost_one_until_its_restart(posed, engine, messages, monkeypatch):
    import ray

    monkeypatch.setattr(actor_pool, "STANDBY_AFTER", 0.0)
    found = actor_pool.IslandActorPool(posed, 3, messages.append)
    try:
        full_size = min(3, count_cpus()) + 1
        eventually(lambda: found.maintain(at_once=True) and len(found.slots) == full_size)
        regular = [found.actor_for(island) for island in range(3)]
        kill(min(eventually(actors)))
        eventually(lambda: found.maintain(at_once=True) and any("was lost" in each for each in messages))
        assert found.slots[0] == actor_pool.STANDBY
        assert len(found.slots) == full_size - 1
        replaced = [
            now for now, before in zip(map(found.actor_for, range(3)), regular, strict=True) if now != before
        ]
        assert replaced
        assert all(now not in regular for now in replaced)
        ray.get([actor.prepare.remote() for actor in replaced])
        eventually(lambda: found.maintain(at_once=True) and len(found.slots) == full_size)
        assert not set(replaced) & {found.actor_for(island) for island in range(3)}
    finally:
        found.shutdown()


@pytest.mark.nightly
def test_repeated_losses_end_the_search_with_advice(posed, engine):
    """For example for lack of memory: the search must not continue for days."""
    over = Event()

    def kill_all():
        while not over.wait(0.01):
            for pid in actors():
                with suppress(ProcessLookupError):
                    kill(pid)

    killer = Thread(target=kill_all)
    killer.start()
    try:
        with pytest.raises(ClusterError, match="actors were lost and no epoch was completed"):
            list(engine.run(posed, empty_archipelago(3, SEED), never))
    finally:
        over.set()
        killer.join()


@pytest.mark.ci
def test_finished_search_leaves_no_actor(posed, engine):
    epochs = engine.run(posed, empty_archipelago(3, SEED), never)
    next(epochs)
    assert actors()
    epochs.close()
    eventually(lambda: not actors())


@pytest.mark.ci
def test_existing_ray_connection_is_left_alone(engine):
    import ray

    with pytest.raises(ClusterError, match="already connected to Ray"), ENGINES["ray"](None, print):
        pass
    assert ray.is_initialized()


@pytest.mark.nightly
def test_a_cluster_with_an_autoscaler_is_asked_for_a_cpu_for_each_island(
    posed, undisturbed, ray_address, engine, monkeypatch
):
    """Without an autoscaler an actor without a CPU would wait for ever, and is not requested."""
    from ray._raylet import GcsClient
    from ray.autoscaler.v2.sdk import get_cluster_resource_state

    def requested():
        state = get_cluster_resource_state(GcsClient(address=ray_address))
        return sum(each.count for each in state.pending_resource_requests)

    # As on a cluster of several machines; on one machine the actors of each job reserve parts of a CPU.
    monkeypatch.setattr(actor_pool, "reserved_cpus", lambda: 1.0)
    missing = 3
    islands = count_cpus() + missing
    for autoscaling, expected in ((False, 0), (True, missing)):
        seen = []
        pool = actor_pool.IslandActorPool(
            posed,
            islands,
            lambda *_: None,
            autoscaling=autoscaling,
            observe=lambda *each, seen=seen: seen.append(each),
        )
        try:
            eventually(lambda pool=pool: pool.maintain(at_once=True) or pool.slots)
            eventually(lambda expected=expected: requested() == expected, seconds=20.0)
            assert seen[0] == (0, islands)
            ready = (islands - missing, missing)
            eventually(
                lambda pool=pool, seen=seen, ready=ready: pool.maintain(at_once=True) and seen[-1] == ready
            )
        finally:
            pool.shutdown()
            assert seen[-1] == (0, 0)
            eventually(lambda: not actors())
    # The search begins with the actors that are ready.
    monkeypatch.setattr(actor_pool, "STARTUP_TIMEOUT", 1.0)
    grown = RayEngine(autoscaling=True).run(posed, empty_archipelago(3, SEED), never)
    assert [exactly(epoch.archipelago) for epoch in grown] == undisturbed
