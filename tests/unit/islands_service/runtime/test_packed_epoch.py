"""`PackedEpoch` and `PackedIslands`: packing, and unpacking at the first access."""

import pickle
from dataclasses import replace

import pytest

from islands.evolution.archipelago import Archipelago, StepInfo
from islands.evolution.engine import IslandEpoch
from islands.evolution.evaluation import Evaluator
from islands.expressions.primitives import PRIMITIVES
from islands_service.runtime import packed_epoch
from islands_service.runtime.packed_epoch import PackedIslands, pack_epoch, unpack_individuals, unpack_island
from support.searches import SMALL, exactly, islands_of, record


@pytest.fixture(scope="module")
def islands():
    return islands_of(Evaluator(record(), SMALL), 3)


@pytest.fixture
def packed(islands):
    return PackedIslands([pack_epoch(IslandEpoch(island, (), ())) for island in islands], PRIMITIVES)


def test_packed_island_is_unpacked_unchanged(islands):
    for island in islands:
        back = unpack_island(pack_epoch(IslandEpoch(island, island.elite[:2], ())).packed, PRIMITIVES)
        assert exactly(back) == exactly(island)
        # Genes are equal as keys, too, although hashes differ between processes and are computed again.
        assert {gene: 0 for each in back.population for gene in each.genes} == {
            gene: 0 for each in island.population for gene in each.genes
        }


def test_packed_epoch_contains_emigrants_steps_and_caches(islands):
    epoch = IslandEpoch(islands[-1], islands[-1].elite[:2], ())
    found = pack_epoch(epoch, "me", {"pairs": (1, 2)})
    assert unpack_individuals(found.emigrants, PRIMITIVES) == epoch.emigrants
    assert found.steps == epoch.steps
    assert (found.actor, found.caches) == ("me", {"pairs": (1, 2)})
    assert pickle.loads(pickle.dumps(found)) == found


def test_packed_islands_behave_like_the_tuple_of_islands(islands, packed):
    assert len(packed) == len(islands)
    assert [*packed] == islands
    assert packed[-1] == islands[-1]
    assert packed[1:3] == tuple(islands[1:3])
    assert islands[2] in packed
    assert exactly(Archipelago(packed)) == exactly(Archipelago(tuple(islands)))


def test_packed_islands_equal_sequences_with_the_same_islands(islands, packed):
    assert packed == tuple(islands)
    assert tuple(islands) == packed
    assert Archipelago(packed) == Archipelago(tuple(islands))
    assert hash(packed) == hash(tuple(islands))
    other = (*islands[:-1], replace(islands[-1], seed=99))
    assert packed != other
    assert packed != tuple(islands[:-1])
    assert packed != 3


def test_index_out_of_range_raises_an_error(islands, packed):
    for place in (len(islands), -len(islands) - 1):
        with pytest.raises(IndexError):
            packed[place]


def test_island_is_unpacked_once_at_its_first_access(monkeypatch, islands):
    opened = []
    monkeypatch.setattr(
        packed_epoch, "unpack_island", lambda *given: opened.append(given) or unpack_island(*given)
    )
    found = PackedIslands([pack_epoch(IslandEpoch(island, (), ())) for island in islands], PRIMITIVES)
    assert len(found) == len(islands)
    assert not opened
    assert found[2] is found[2]
    assert len(opened) == 1


def test_front_of_packed_islands_is_that_of_the_islands_and_unpacks_few(islands, packed, monkeypatch):
    expected = Archipelago(tuple(islands)).find_front()
    assert exactly(Archipelago(packed).find_front()) == exactly(expected)
    stated = [
        StepInfo(0, 0, 0, {}, {size: each.fitness for size, each in island.hall_of_fame.best().items()})
        for island in islands
    ]
    # The second one of two equal islands has no model that the first one lacks.
    reports = [
        pack_epoch(IslandEpoch(island, (), (step,))) for island, step in zip(islands, stated, strict=True)
    ]
    unpacked = []
    unpack = packed_epoch.unpack_island
    monkeypatch.setattr(
        packed_epoch, "unpack_island", lambda *given: unpacked.append(given) or unpack(*given)
    )
    twice = PackedIslands([*reports, *reports], PRIMITIVES)
    assert exactly(Archipelago(twice).find_front()) == exactly(expected)
    assert len(unpacked) <= len(islands)
