"""A cluster of nodes with separate object stores: the result is the same if a node or an island is lost."""

import os
import time
from dataclasses import replace
from threading import Timer

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.problem import Problem
from islands_service.runtime.cluster import cluster
from islands_service.runtime.ray_engine import RayEngine
from support.processes import actors, descendants, eventually, kill
from support.searches import SMALL, exactly, record

pytestmark = pytest.mark.nightly

SETTINGS = replace(SMALL, islands=4, generations=8, migrate_every=1, migrants=2, topology="torus")


def never():
    return False


@pytest.fixture(scope="module")
def posed():
    return Problem(record(), SETTINGS)


@pytest.fixture(scope="module")
def undisturbed(posed):
    return [exactly(epoch.archipelago) for epoch in SerialEngine().run(posed, empty_archipelago(4, 5), never)]


@pytest.fixture
def head():
    from ray.cluster_utils import Cluster

    # A process reads its token once, and another test in this process may have set one.
    os.environ.setdefault("RAY_AUTH_TOKEN", "0123456789abcdef0123456789abcdef")
    started = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "object_store_memory": 10**8})
    try:
        yield started
    finally:
        started.shutdown()


def add(head):
    return head.add_node(num_cpus=1, object_store_memory=10**8)


@pytest.mark.parametrize("lost", [False, True])
def test_two_nodes_find_the_models_of_one_process_despite_a_loss(head, posed, undisturbed, lost):
    import ray

    nodes = [add(head), add(head)]
    messages, seen = [], []
    with cluster(head.address):
        eventually(lambda: ray.cluster_resources().get("CPU") == 2)
        for epoch in RayEngine(messages.append).run(posed, empty_archipelago(4, 5), never):
            seen.append(exactly(epoch.archipelago))
            if lost and len(seen) == 3:
                # The machine is lost with all of its processes.
                raylet = nodes[1].all_processes["raylet"][0].process.pid
                for pid in (raylet, *descendants(raylet)):
                    kill(pid)
    assert seen == undisturbed
    assert any("an actor was lost" in line for line in messages) == lost


def test_search_without_a_cpu_begins_when_a_machine_joins(head, posed, undisturbed):
    messages = []

    def tell(line):
        messages.append(line)
        add(head)

    with cluster(head.address):
        seen = [
            exactly(epoch.archipelago) for epoch in RayEngine(tell).run(posed, empty_archipelago(4, 5), never)
        ]
    assert messages[0].startswith("waiting for capacity: 0 of 1 island actors are ready")
    assert seen == undisturbed


def test_an_island_killed_inside_an_epoch_on_three_nodes_changes_nothing(head):
    settings = replace(SMALL, islands=3, generations=120, migrate_every=40, population=200)
    problem = Problem(record(2000), settings)
    began = time.monotonic()
    undisturbed = [
        exactly(each.archipelago) for each in SerialEngine().run(problem, empty_archipelago(3, 5), never)
    ]
    epoch_seconds = (time.monotonic() - began) / len(undisturbed) / settings.islands
    messages, seen, timers = [], [], []
    for _ in range(3):
        add(head)
    with cluster(head.address):
        for epoch in RayEngine(messages.append).run(problem, empty_archipelago(3, 5), never):
            seen.append(exactly(epoch.archipelago))
            if len(seen) == 2:  # the first epoch makes the populations
                timers.append(Timer(epoch_seconds / 3.0, lambda: kill(min(actors()))))
                timers[0].start()
    timers[0].join()
    assert seen == undisturbed
    assert any("an actor was lost" in line for line in messages)
