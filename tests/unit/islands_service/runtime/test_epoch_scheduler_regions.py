"""`EpochScheduler` for the islands of a region: emigrants of other islands arrive from elsewhere."""

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from islands.evolution.archipelago import empty_archipelago
from islands.evolution.engine import IslandEpoch
from islands.evolution.migration import parse_topology
from islands_service.runtime.epoch_scheduler import EpochScheduler, EpochTask
from islands_service.runtime.regions import REGION_SIZE, count_regions
from support.epoch_runs import (
    SEED,
    compute_epoch,
    get_emigrants,
    posed,
    run_in_lockstep,
    searches,
)


def make_regions(problem, bounds, ahead):
    """Return a scheduler for each range of islands, and the sources of all islands."""
    islands = empty_archipelago(problem.settings.islands, SEED).islands
    sources = parse_topology(problem.settings.topology, len(islands), SEED).sources
    edges = [0, *sorted(bounds), len(islands)]
    spans = [range(first, last) for first, last in pairwise(edges) if first < last]
    return [
        EpochScheduler(
            problem.settings,
            sources,
            -1,
            {index: IslandEpoch(islands[index], (), ()) for index in span},
            ahead,
        )
        for span in spans
    ], sources


@settings(max_examples=30)
@given(searches(), st.sets(st.integers(1, 7)), st.integers(0, 2**32))
def test_regions_complete_the_epochs_of_the_whole_search(search, bounds, seed):
    problem, ends, ahead = search
    size = problem.settings.islands
    regions, sources = make_regions(problem, {bound for bound in bounds if bound < size}, ahead)
    choose = random.Random(seed)
    owner = {island: region for region in regions for island in region.known}
    emigrants = {(island, -1): () for island in range(size)}
    pending = {id(region): [] for region in regions}
    done = {id(region): [] for region in regions}
    while not all(region.finished for region in regions):
        # Emigrants cross a border when the epoch of their whole region is complete.
        for region in regions:
            at = region.completed_generation
            for island in region.known:
                for source in sources[island]:
                    if owner[source] is not region and owner[source].completed_generation >= at:
                        region.receive(source, at)
            pending[id(region)] += region.ready_tasks()
        ready = [
            (region, task)
            for region in regions
            for task in pending[id(region)]
            if all((each, task.begin) in emigrants for each in (task.island, *sources[task.island]))
        ]
        region, task = choose.choice(ready)
        pending[id(region)].remove(task)
        arriving = [emigrants[source, task.begin] for source in sources[task.island]]
        epoch = compute_epoch(task, region.known[task.island][task.begin].island, arriving)
        emigrants[task.island, task.end] = get_emigrants(epoch)
        region.complete(task, epoch)
        done[id(region)] += region.completed_epochs()
    whole = [sum(parts, ()) for parts in zip(*(done[id(region)] for region in regions), strict=True)]
    assert whole == list(run_in_lockstep(problem, ends))


def test_an_island_waits_for_an_arrival_and_others_wait_for_that_island():
    problem = posed(islands=4)
    (_, last), _ = make_regions(problem, {2}, 3)
    # Island 2 receives from island 1 of the other region, and island 3 from island 2.
    assert list(last.ready_tasks()) == [EpochTask(3, -1, 0)]
    last.receive(1, -1)
    assert list(last.ready_tasks()) == [EpochTask(2, -1, 0), EpochTask(3, 0, 4)]
    last.receive(1, 0)
    assert list(last.ready_tasks()) == [EpochTask(2, 0, 4), EpochTask(3, 4, 8)]


@pytest.mark.parametrize(
    ("islands", "cpus", "regions"),
    [
        (1, 1, 1),
        (REGION_SIZE, 10_000, 1),
        (REGION_SIZE + 1, 10_000, 2),
        (10_000, 10_000, 20),
        (10_000, 64, 1),
        (10_000, 0, 1),
    ],
)
def test_the_number_of_regions_is_that_of_islands_that_compute_at_once(islands, cpus, regions):
    assert count_regions(islands, cpus) == regions
