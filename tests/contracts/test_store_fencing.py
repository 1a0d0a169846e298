"""Contract of the store with a coordinator that has lost its lease: all of its writes are refused."""

from functools import partial

import pytest

from islands_service.domain.job import JobState, LeaseLostError, ProgressReport
from support.stores import (
    ALICE,
    CANCELLED,
    EXPIRED,
    FAILED,
    FOUND,
    LONG,
    at_once,
    brought_on,
    claimed,
    contents,
    kinds,
    open_stores,
    submitted,
)

#: All operations under a lease.
WRITES = {
    "renew": lambda leases, lease: leases.renew(lease, LONG),
    "report": lambda leases, lease: leases.report(lease, brought_on(9)),
    "progress alone": lambda leases, lease: leases.report(lease, ProgressReport({"phase": "search"})),
    "release": lambda leases, lease: leases.release(lease),
    "release of an attempt": lambda leases, lease: leases.release(lease, attempted=True),
    "finish": lambda leases, lease: leases.finish(lease, FOUND),
    "fail": lambda leases, lease: leases.finish(lease, FAILED),
    "cancel": lambda leases, lease: leases.finish(lease, CANCELLED),
}


def taken_over(store, lease):
    claimed(store)


def taken_over_and_brought_on(store, lease):
    store.leases.report(claimed(store), brought_on(5))


def released_by_another(store, lease):
    store.leases.release(claimed(store))


def released_by_itself(store, lease):
    store.leases.release(lease)


def finished_by_another(store, lease):
    store.leases.finish(claimed(store), FOUND)


def finished_by_itself(store, lease):
    store.leases.finish(lease, FOUND)


def failed_and_waiting_again(store, lease):
    store.leases.finish(lease, FAILED)
    store.jobs.resume(ALICE, lease.job.id)


def failed_and_claimed_again(store, lease):
    failed_and_waiting_again(store, lease)
    claimed(store)


def cancelled_and_deleted(store, lease):
    store.leases.finish(lease, CANCELLED)
    store.jobs.delete(ALICE, lease.job.id)


#: Ways to lose a job with an expired lease.
LOSSES = [
    taken_over,
    taken_over_and_brought_on,
    released_by_another,
    released_by_itself,
    finished_by_another,
    finished_by_itself,
    failed_and_waiting_again,
    failed_and_claimed_again,
    cancelled_and_deleted,
]


@pytest.mark.parametrize("loss", LOSSES, ids=lambda loss: loss.__name__)
def test_writes_under_a_lost_lease_change_nothing(store, loss):
    job = submitted(store)
    submitted(store, priority=-1)
    lease = claimed(store, EXPIRED)
    loss(store, lease)
    before = contents(store)
    for write in WRITES.values():
        with pytest.raises(LeaseLostError, match=job.id):
            write(store.leases, lease)
        assert contents(store) == before


def test_epochs_of_a_job_rise_with_every_claim(store):
    job = submitted(store)
    epochs = []
    for end in (FAILED, CANCELLED, FAILED):
        lease = claimed(store, EXPIRED)
        later = claimed(store)
        store.leases.release(later)
        last = claimed(store)
        store.leases.finish(last, end)
        store.jobs.resume(ALICE, job.id)
        epochs += [each.epoch for each in (lease, later, last)]
    assert epochs == list(range(1, 10))


def test_job_finished_twice_keeps_the_outcome_of_its_lease(database):
    """The old coordinator finishes while its successor claims and finishes: exactly one outcome is stored."""
    with open_stores(database, 2) as (one, other):
        for turn in range(20):
            job = submitted(one, name=f"{turn}")
            old = claimed(one, EXPIRED)

            def succeed():
                new = other.leases.claim(f"successor {turn}", LONG)  # noqa: B023 - called in this turn
                if new is not None:
                    other.leases.finish(new, FAILED)
                return new

            late, successor = at_once([partial(one.leases.finish, old, FOUND), succeed])
            found = one.jobs.get(ALICE, job.id)
            models = one.results.models(job.id)
            if isinstance(late, LeaseLostError):
                assert (found.state, models) == (JobState.FAILED, [])
                assert kinds(one, job.id) == ["queued", "running", "running", "failed"]
            else:
                assert late is successor is None
                assert (found.state, len(models)) == (JobState.SUCCEEDED, 2)
                assert kinds(one, job.id) == ["queued", "running", "succeeded"]
