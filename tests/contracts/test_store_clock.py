"""Contract of the store when the clock of the database jumps."""

import pytest

from islands_service.domain.job import LeaseLostError
from support.stores import ALICE, LONG, claimed, kinds, submitted, turn_clock

#: Seconds of a lease in these tests.
LEASE = 60.0

HOUR = 3600.0


def test_job_of_a_lost_coordinator_is_taken_over_after_the_clock_has_gone_back(store):
    """Its lease would last for an hour more, and a coordinator of another name would wait for it."""
    job = submitted(store)
    lost = claimed(store, LEASE)
    turn_clock(store, -HOUR)
    taken = store.leases.claim("second", LEASE)
    assert (taken.job.id, taken.epoch) == (job.id, 2)
    with pytest.raises(LeaseLostError):
        store.leases.renew(lost, LEASE)


def test_running_coordinator_keeps_its_job_after_the_clock_has_gone_back(store):
    submitted(store)
    lease = claimed(store, LEASE)
    turn_clock(store, -HOUR)
    store.leases.renew(lease, LEASE)
    assert store.leases.claim("second", LEASE) is None


@pytest.mark.parametrize("seconds", [-0.5, 0.0])
def test_lease_is_respected_whatever_the_lease_of_others(store, seconds):
    """The clock of a server may be adjusted by less than a second, and settings may differ."""
    submitted(store)
    claimed(store, LONG)
    turn_clock(store, seconds)
    assert store.leases.claim("second", 1.0) is None


def test_postponed_job_is_tried_after_the_clock_has_gone_back(store):
    job = submitted(store)
    store.leases.postpone(claimed(store), "in this test", 10.0)
    assert store.leases.claim("second", LEASE) is None
    turn_clock(store, -HOUR)
    assert claimed(store).job.id == job.id


def test_job_is_taken_over_once_after_the_clock_has_gone_forward(store):
    job = submitted(store)
    lost = claimed(store, LEASE)
    turn_clock(store, HOUR)
    taken = store.leases.claim("second", LEASE)
    assert (taken.job.id, taken.epoch) == (job.id, 2)
    assert store.leases.claim("third", LEASE) is None
    with pytest.raises(LeaseLostError):
        store.leases.renew(lost, LEASE)
    assert kinds(store, job.id) == ["queued", "running", "running"]
    assert store.jobs.get(ALICE, job.id).started is not None
