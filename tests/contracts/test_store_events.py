"""Contract of the store with watching clients: events without gaps, in the order of visibility."""

import threading

import pytest

from islands_service.domain.job import DISCREPANCY, JobState, JobStateError
from islands_service.store.leases import ATTEMPTS
from support.stores import (
    ALICE,
    EXPIRED,
    FAILED,
    FOUND,
    LONG,
    asked,
    at_once,
    brought_on,
    claimed,
    job_in,
    kinds,
    open_stores,
    submitted,
)


def test_every_change_of_a_job_is_an_event_with_its_version(store):
    job = submitted(store)
    lease = claimed(store, EXPIRED)
    store.leases.report(lease, brought_on(1))
    lease = claimed(store)
    store.leases.release(lease)
    lease = claimed(store)
    store.leases.finish(lease, FAILED)
    store.jobs.resume(ALICE, job.id)
    last = [claimed(store, EXPIRED).is_last for _ in range(ATTEMPTS)]
    assert last == [*[False] * (ATTEMPTS - 1), True]
    assert store.leases.claim("another", LONG) is None
    store.jobs.resume(ALICE, job.id)
    store.jobs.cancel(ALICE, job.id)
    store.jobs.resume(ALICE, job.id)
    lease = claimed(store)
    store.jobs.cancel(ALICE, job.id)
    store.leases.finish(lease, FOUND)
    assert kinds(store, job.id) == [
        *("queued", "running", "progress", "running", "queued", "running", "failed"),
        *("queued", *["running"] * ATTEMPTS, "failed", "queued", "cancelled"),
        *("queued", "running", "cancelling", "succeeded"),
    ]
    times = [event.at for event in store.jobs.events(job.id)]
    assert times == sorted(times)
    assert times[-1] == store.jobs.get(ALICE, job.id).updated


def test_request_to_stop_a_search_is_one_event_and_ends_with_a_resumption(store):
    job = submitted(store)
    lease = claimed(store)
    store.jobs.stop(ALICE, job.id)
    assert store.jobs.stop(ALICE, job.id).version == 3
    assert kinds(store, job.id) == ["queued", "running", "stopping"]
    store.leases.finish(lease, FAILED)
    assert store.jobs.get(ALICE, job.id).stop_requested
    assert not store.jobs.resume(ALICE, job.id).stop_requested


@pytest.mark.parametrize("other", [{"kind": DISCREPANCY}, {"spec": {"model": "wiener"}}])
def test_only_a_search_is_stopped(store, other):
    job = submitted(store, **other)
    claimed(store)
    with pytest.raises(JobStateError, match="has no search to stop: wait for its end, or cancel it"):
        store.jobs.stop(ALICE, job.id)


@pytest.mark.ci
def test_reader_that_continues_from_the_last_number_misses_nothing(database):
    """The coordinator reports while the owner cancels and resumes, and both write at the same time."""
    with open_stores(database, 3) as (coordinator, owner, reader):
        job = submitted(coordinator)
        over = threading.Event()

        def bring_on():
            for turn in range(40):
                lease = coordinator.leases.claim(f"{turn}", LONG)
                if lease is None:
                    continue
                for generation in range(3):
                    coordinator.leases.report(lease, brought_on(generation))
                coordinator.leases.release(lease)

        def cancel_and_resume():
            for turn in range(60):
                ask = (owner.jobs.cancel, owner.jobs.resume)[turn % 2]
                try:
                    ask(ALICE, job.id)
                except JobStateError:
                    continue

        def read():
            seen = []
            while not over.wait(0.001):
                seen += [event.number for event in reader.jobs.events(job.id, seen[-1] if seen else 0)]
            seen += [event.number for event in reader.jobs.events(job.id, seen[-1] if seen else 0)]
            return seen

        def write():
            failures = [each for each in at_once([bring_on, cancel_and_resume]) if each is not None]
            over.set()
            return failures

        failures, *readers = at_once([write, read, read])
        assert failures == []
        last = reader.jobs.versions([job.id])[job.id]
        assert last > 10
        for seen in readers:
            assert seen == list(range(1, last + 1))


def test_reader_that_sees_a_version_finds_its_event(database):
    with open_stores(database, 2) as (writer, reader):
        job = submitted(writer)
        lease = claimed(writer)
        over = threading.Event()

        def write():
            try:
                for generation in range(100):
                    writer.leases.report(lease, brought_on(generation))
            finally:
                over.set()

        def read():
            looks = 0
            while not over.wait(0.001):
                version = reader.jobs.versions([job.id])[job.id]
                assert reader.jobs.events(job.id, version - 1)[0].number == version
                looks += 1
            return looks

        written, looks = at_once([write, read])
        assert written is None
        assert looks > 0


@pytest.mark.parametrize("waiting", [0, 3])
def test_queue_statistics_count_the_jobs_of_all_owners(store, waiting):
    before = store.jobs.queue_statistics()
    assert before.counts == dict.fromkeys(JobState, 0)
    assert (before.oldest, before.running, before.leases) == (0.0, {}, 0)
    for state in (JobState.SUCCEEDED, JobState.FAILED, JobState.FAILED):
        job_in(store, state)
    running = job_in(store, JobState.RUNNING)
    store.leases.report(claimed_again := claimed_as(store, asked(priority=9)), brought_on(4))
    store.leases.renew(claimed_again, EXPIRED)
    for _ in range(waiting):
        submitted(store, "bob")
    statistics = store.jobs.queue_statistics()
    assert statistics.counts == {
        JobState.QUEUED: waiting,
        JobState.RUNNING: 2,
        JobState.SUCCEEDED: 1,
        JobState.FAILED: 2,
        JobState.CANCELLED: 0,
    }
    # An expired lease does not count.
    assert statistics.running == {running.id: {}}
    assert statistics.leases == 1
    assert (statistics.oldest > 0) == bool(waiting)


def claimed_as(store, submission):
    store.jobs.submit(submission)
    return claimed(store)
