"""Contract of the quota of running islands: what may be submitted, and when a queued job is claimed."""

import time
from uuid import uuid4

import pytest

from support.stores import (
    ALICE,
    BOB,
    CANCELLED,
    EXPIRED,
    LONG,
    MANY,
    asked,
    at_once,
    open_stores,
    submitted,
)


@pytest.fixture
def claim(store):
    """Return a function that claims a job under a quota, by default of 4 islands."""

    def claim(most=4, seconds=LONG):
        return store.leases.claim(uuid4().hex, seconds, most_islands=most)

    return claim


def size(lease):
    return None if lease is None else lease.job.spec["islands"]


def queue(store, owner, *sizes):
    """Submit jobs with these numbers of islands, in this order."""
    for each in sizes:
        # The clock of SQLite has a resolution of a millisecond.
        time.sleep(0.002)
        submitted(store, owner, islands=each, spec={"islands": each})


@pytest.mark.parametrize("own", [None, 6])
def test_jobs_are_claimed_up_to_the_quota(store, claim, own):
    """The quota that is set precedes the one of the coordinator. Owners have separate ones."""
    queue(store, ALICE, 3, 2, 1, 1)
    queue(store, BOB, 4)
    if own is not None:
        store.owners.change(ALICE, {"max_islands": own})
    leases = [claim(6 if own is None else 4) for _ in range(5)]
    assert sorted(size(lease) for lease in leases if lease is not None) == [1, 2, 3, 4]
    assert store.owners.get(ALICE).running_islands == 6
    assert store.owners.get(BOB).running_islands == 4
    store.leases.finish(next(lease for lease in leases if size(lease) == 2), CANCELLED)
    assert [size(claim(6 if own is None else 4)) for _ in range(2)] == [1, None]


def test_smaller_jobs_do_not_overtake_a_large_one(store, claim):
    queue(store, ALICE, 2, 1, 4, *[1] * 6)
    first, second = claim(), claim()
    assert (size(first), size(second)) == (2, 1)
    for lease in (first, second):
        # One island is free in any case, then two.
        assert claim() is None
        store.leases.finish(lease, CANCELLED)
    large = claim()
    assert (size(large), claim()) == (4, None)
    store.leases.finish(large, CANCELLED)
    assert [size(claim()) for _ in range(5)] == [1, 1, 1, 1, None]


def test_owner_whose_job_does_not_fit_delays_no_other(store, claim):
    queue(store, ALICE, 3, 4)
    assert size(claim()) == 3
    queue(store, BOB, 1, 2)
    assert [size(claim()) for _ in range(3)] == [1, 2, None]


def test_waiting_for_islands_costs_no_turn(store, claim):
    queue(store, ALICE, 3, 4)
    large = claim()
    queue(store, BOB, *[1] * 3)
    assert [size(claim()) for _ in range(3)] == [1, 1, 1]
    store.leases.finish(large, CANCELLED)
    queue(store, BOB, 1)
    assert size(claim()) == 4


def test_accepted_job_runs_alone_after_the_quota_was_lowered(store, claim):
    job, _ = store.jobs.submit(asked(islands=8, spec={"islands": 8}, idempotency_key="k"), most_islands=8)
    queue(store, ALICE, 1)
    assert store.jobs.submit(asked(islands=8, spec={"islands": 8}, idempotency_key="k"), most_islands=4) == (
        job,
        False,
    )
    submitted(store, priority=1, spec={"islands": 1})
    small = claim()
    assert (size(small), claim()) == (1, None)
    store.leases.finish(small, CANCELLED)
    large = claim()
    assert (size(large), claim()) == (8, None)
    store.leases.finish(large, CANCELLED)
    small = claim()
    # The quota refuses no job that was accepted.
    store.owners.change(ALICE, {"max_islands": 4})
    store.jobs.resume(ALICE, job.id)
    assert (size(small), claim()) == (1, None)
    store.leases.finish(small, CANCELLED)
    assert size(claim()) == 8


def test_quota_of_zero_pauses_an_owner(store, claim):
    queue(store, ALICE, 1)
    store.owners.change(ALICE, {"max_islands": 0})
    assert claim() is None
    store.owners.change(ALICE, {"max_islands": None})
    assert size(claim()) == 1


def test_lost_job_is_taken_over_whatever_the_quota(store, claim):
    queue(store, ALICE, 3)
    claim(seconds=EXPIRED)
    assert size(claim(1)) == 3


@pytest.mark.ci
def test_concurrent_claims_do_not_exceed_the_quota(database):
    with open_stores(database) as stores:
        queue(stores[0], ALICE, *[3] * MANY)
        answers = at_once(
            [
                lambda store=stores[i % 4], i=i: store.leases.claim(f"{i}", LONG, most_islands=10)
                for i in range(MANY)
            ]
        )
        assert [size(lease) for lease in answers if lease is not None] == [3, 3, 3]


def test_place_of_a_queued_job_names_the_quota_that_it_waits_for(store, claim):
    queue(store, ALICE, 3, 2)

    def notes(**quotas):
        return [
            place.note for place in store.leases.queue_places(store.jobs.page(ALICE).jobs, **quotas).values()
        ]

    assert notes(most_running=1, most_islands=4) == ["", ""]
    lease = claim()
    assert notes() == notes(most_running=2, most_islands=5) == [""]
    assert notes(most_islands=4) == [
        "waits for your quota of running islands: 3 of 4 are running, and this job has 2"
    ]
    store.owners.change(ALICE, {"max_running": 1})
    assert notes(most_islands=4) == ["waits for your quota of running jobs: 1 of 1 are running"]
    store.leases.finish(lease, CANCELLED)
    assert notes(most_islands=4) == [""]
