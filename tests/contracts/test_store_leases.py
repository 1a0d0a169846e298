"""Contract of the store with coordinators: order of claims, duration of leases, number of attempts."""

from uuid import uuid4

import pytest

from support.stores import (
    ALICE,
    BOB,
    CANCELLED,
    EXPIRED,
    LONG,
    MANY,
    at_once,
    claimed,
    kinds,
    open_stores,
    submitted,
)


@pytest.mark.parametrize("own", [None, 2])
def test_owner_with_its_quota_of_running_jobs_waits_and_others_do_not(store, own):
    """The quota that is set precedes the one of the coordinator."""
    most = 2 if own is None else 1000
    jobs = [submitted(store) for _ in range(4)]
    if own is not None:
        store.owners.change(ALICE, {"max_running": own})
    other = submitted(store, BOB)

    def claim():
        return store.leases.claim(uuid4().hex, LONG, most_running=most)

    leases = [claim() for _ in range(3)]
    assert sorted(lease.job.owner for lease in leases) == [ALICE, ALICE, BOB]
    assert claim() is None
    finished = next(lease for lease in leases if lease.job.owner == ALICE)
    store.leases.finish(finished, CANCELLED)
    assert claim().job.id in {job.id for job in jobs}
    assert claim() is None
    assert other.id in {lease.job.id for lease in leases}


def test_concurrent_claims_do_not_exceed_the_quota_of_running_jobs(database):
    with open_stores(database) as stores:
        for _ in range(MANY):
            submitted(stores[0])
        answers = at_once(
            [
                lambda store=stores[i % 4], i=i: store.leases.claim(f"{i}", LONG, most_running=3)
                for i in range(MANY)
            ]
        )
        assert sum(lease is not None for lease in answers) == 3


def test_every_job_is_claimed_once_by_concurrent_claimers(database):
    with open_stores(database) as stores:
        jobs = [submitted(stores[0], priority=each % 3) for each in range(24)]

        def claim_all(store, name):
            taken = []
            while (lease := store.leases.claim(f"{name} {len(taken)}", LONG)) is not None:
                taken.append(lease.job)
            return taken

        taken = at_once(
            [lambda store=stores[i % 4], i=i: claim_all(store, f"thread {i}") for i in range(MANY)]
        )
        assert sorted(job.id for each in taken for job in each) == sorted(job.id for job in jobs)
        for each in taken:
            priorities = [job.priority for job in each]
            assert priorities == sorted(priorities, reverse=True)
        for job in jobs:
            assert kinds(stores[0], job.id) == ["queued", "running"]


def test_claim_and_renewal_contain_the_request_to_stop_the_search(store):
    job = submitted(store)
    lease = claimed(store, EXPIRED, "first")
    assert store.leases.read_requests(lease) == (False, False)
    assert not store.leases.renew(lease, EXPIRED).stop_requested
    store.jobs.stop(ALICE, job.id)
    assert store.leases.read_requests(lease) == (False, True)
    assert store.leases.renew(lease, EXPIRED).stop_requested
    assert claimed(store, LONG, "second").job.stop_requested


def test_a_job_lets_others_pass_until_no_owner_has_a_smaller_share(store):
    """Whatever the number of jobs that wait."""
    for _ in range(3):
        submitted(store, ALICE)
    mine = [claimed(store), claimed(store)]
    assert not store.leases.is_turn_over(mine[0])
    for _ in range(3):
        submitted(store, BOB)
    assert store.leases.is_turn_over(mine[0])
    store.leases.release(mine[0], reason="others")
    others = claimed(store)
    assert others.job.owner == BOB
    assert store.jobs.get(ALICE, mine[0].job.id).progress["note"] == "others"
    assert not store.leases.is_turn_over(mine[1])
    assert not store.leases.is_turn_over(others)
    store.owners.change(BOB, {"weight": 300})
    assert store.leases.is_turn_over(mine[1])


def test_a_job_that_cannot_be_claimed_interrupts_no_other_one(store):
    submitted(store, BOB)
    postponed = claimed(store)
    store.leases.postpone(postponed, "later", LONG)
    submitted(store, ALICE)
    mine = claimed(store)
    assert mine.job.owner == ALICE
    assert not store.leases.is_turn_over(mine)
    submitted(store, BOB)
    assert store.leases.is_turn_over(mine)
    assert not store.leases.is_turn_over(mine, most_running=0)
