"""Searches in regions: the result equals that of the serial engine, bit for bit, also after losses."""

import gzip
import os
import signal
from dataclasses import replace

import pytest

from islands.evolution.archipelago import Archipelago, empty_archipelago
from islands.evolution.engine import SerialEngine
from islands.evolution.problem import Problem
from islands.persistence.checkpoints import compressed_checkpoint, read_checkpoint, write_checkpoint
from islands_service.engines import ENGINES
from islands_service.runtime import ClusterError, regions
from islands_service.runtime.regions import RegionIslands, run_regions
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


@pytest.fixture
def path(tmp_path):
    return tmp_path / "checkpoint.json"


def checkpoint(epoch):
    """Return the text of a checkpoint of the service."""
    return gzip.decompress(b"".join(compressed_checkpoint(epoch.archipelago, {"seed": SEED})))


def coordinators():
    """Return the processes of the coordinators of regions."""
    return [pid for pid, line in descendants(os.getpid()).items() if "RegionActor" in line]


@pytest.mark.nightly
def test_a_killed_coordinator_of_a_region_changes_neither_result_nor_checkpoint(posed, whole, messages, path):
    found, texts = [], []
    for epoch in run_regions(posed, empty_archipelago(6, SEED), never, 2, messages.append):
        found.append(epoch)
        if len(found) == 3:
            kill(victim := min(eventually(coordinators)))
            eventually(lambda: not alive([victim]))
            texts.append(checkpoint(epoch))
            assert exactly(epoch.archipelago.find_front()) == exactly(whole[2].archipelago.find_front())
            assert not epoch.archipelago.islands._regions  # they are rendered where they are
    assert [epoch.steps for epoch in found] == [epoch.steps for epoch in whole]
    # The actors have ended, and the islands of the last epoch are still here.
    eventually(lambda: not (actors() or coordinators()))
    assert exactly(found[-1].archipelago) == exactly(whole[-1].archipelago)
    texts.append(checkpoint(found[-1]))
    for text, epoch in zip(texts, (whole[2], whole[-1]), strict=True):
        write_checkpoint(epoch.archipelago, path, {"seed": SEED})
        assert text == path.read_bytes()
    assert sum("the coordinator of the islands" in message for message in messages) == 1


@pytest.mark.nightly
def test_lost_islands_are_a_loss_of_the_cluster(posed, whole, messages):
    import ray

    gone = ray.remote(max_retries=0)(lambda: os._exit(1)).remote()
    islands = RegionIslands([0, 3], 6, [ray.put(()), gone], posed, ray.put(posed))
    lost = replace(whole[0], archipelago=Archipelago(islands))
    for access in (lambda: checkpoint(lost), lambda: islands[4], lost.archipelago.find_front):
        with pytest.raises(ClusterError, match="islands were lost"):
            access()


@pytest.mark.nightly
def test_a_search_in_regions_continues_from_any_checkpoint(posed, whole, messages, path):
    write_checkpoint(whole[3].archipelago, path, {})
    start, _ = read_checkpoint(path)
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
