"""Searches in regions: the result equals that of the serial engine, bit for bit, also after losses."""

import os
import signal
from dataclasses import replace

import pytest

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.problem import Problem
from islands_service.engines import ENGINES
from islands_service.runtime import regions
from islands_service.runtime.regions import run_regions
from support.processes import actors, alive, descendants, eventually, kill
from support.searches import SMALL, exactly, record

SETTINGS = replace(
    SMALL, islands=6, generations=8, migrate_every=1, migrants=2, topology="bidirectional-ring"
)
SEED = 5


def never():
    return False


@pytest.fixture(scope="module")
def posed():
    return Problem(record(), SETTINGS)


@pytest.fixture(scope="module")
def whole(posed):
    return list(SerialEngine().run(posed, empty_archipelago(6, SEED), never))


@pytest.fixture
def messages(ray_address):
    found = []
    with ENGINES["ray"](ray_address, found.append):
        yield found
    eventually(lambda: not actors())


def coordinators():
    """Return the processes of the coordinators of regions."""
    return [pid for pid, line in descendants(os.getpid()).items() if "RegionActor" in line]


@pytest.mark.ci
def test_a_killed_coordinator_of_a_region_does_not_change_the_result(posed, whole, messages):
    found = []
    for epoch in run_regions(posed, empty_archipelago(6, SEED), never, 2, messages.append):
        found.append(epoch)
        if len(found) == 3:
            kill(victim := min(eventually(coordinators)))
            eventually(lambda: not alive([victim]))
    assert [epoch.steps for epoch in found] == [epoch.steps for epoch in whole]
    # The actors have ended, and the islands of the last epoch are still here.
    eventually(lambda: not (actors() or coordinators()))
    assert exactly(found[-1].archipelago) == exactly(whole[-1].archipelago)
    assert sum("the coordinator of the islands" in message for message in messages) == 1


@pytest.mark.nightly
def test_a_search_in_regions_continues_from_any_archipelago(posed, whole, messages):
    start = whole[3].archipelago
    found = list(run_regions(posed, start, never, 2, messages.append))
    assert [epoch.steps for epoch in found] == [epoch.steps for epoch in whole[4:]]
    assert exactly(found[-1].archipelago) == exactly(whole[-1].archipelago)


@pytest.mark.nightly
def test_a_frozen_coordinator_of_a_region_is_replaced(posed, whole, messages, monkeypatch):
    monkeypatch.setattr(regions, "_SILENCE_SECONDS", 3.0)
    found, frozen = [], 0
    for epoch in run_regions(posed, empty_archipelago(6, SEED), never, 2, messages.append):
        found.append(epoch)
        if len(found) == 3:
            frozen = min(eventually(coordinators))
            os.kill(frozen, signal.SIGSTOP)
    assert exactly(found[-1].archipelago) == exactly(whole[-1].archipelago)
    assert any("did not answer" in message for message in messages)
    eventually(lambda: not alive([frozen]))
