"""Contract of the store with owners: allowed operations by state, complete lists, separation of owners."""

import pytest

from islands_service.domain.job import JobNotFoundError, JobState, JobStateError
from islands_service.store.datasets import DatasetNotFoundError
from support.stores import (
    ALICE,
    BOB,
    FAILED,
    FOUND,
    brought_on,
    claimed,
    contents,
    job_in,
    kinds,
    submitted,
)

QUEUED, RUNNING, SUCCEEDED, FAILED_, CANCELLED = JobState

#: Operations of an owner by state, and the following state; in all other states they are refused.
ALLOWED = {
    "cancel": {QUEUED: CANCELLED, RUNNING: RUNNING},
    "resume": {FAILED_: QUEUED, CANCELLED: QUEUED},
    "delete": {SUCCEEDED: None, FAILED_: None, CANCELLED: None},
}

UNKNOWN = "0" * 32


@pytest.mark.parametrize("state", JobState)
@pytest.mark.parametrize("ask", ALLOWED)
def test_operation_is_allowed_only_in_its_states(store, ask, state):
    job = job_in(store, state)
    before = contents(store)
    if state not in ALLOWED[ask]:
        with pytest.raises(JobStateError, match=f"job {job.id} is {state}: "):
            getattr(store.jobs, ask)(ALICE, job.id)
        assert contents(store) == before
        return
    answer = getattr(store.jobs, ask)(ALICE, job.id)
    following = ALLOWED[ask][state]
    if following is None:
        assert {table for table, rows in contents(store).items() if rows} <= {"owners"}
    else:
        assert answer == store.jobs.get(ALICE, job.id)
        assert (answer.state, answer.version) == (following, job.version + 1)
        kinds(store, job.id)


def test_late_cancel_request_does_not_discard_a_result(store):
    job = submitted(store)
    lease = claimed(store)
    store.jobs.cancel(ALICE, job.id)
    store.leases.finish(lease, FOUND)
    assert store.jobs.get(ALICE, job.id).state == SUCCEEDED
    assert kinds(store, job.id) == ["queued", "running", "cancelling", "succeeded"]


def test_deleted_job_leaves_no_rows_and_other_jobs_are_unchanged(store):
    for _ in range(2):
        submitted(store)
        lease = claimed(store)
        store.leases.report(lease, brought_on(1))
        store.leases.finish(lease, FOUND)
        store.results.keep(lease.job.id, {"a": "1" * 64})
    before = contents(store)
    store.jobs.delete(ALICE, lease.job.id)
    after = contents(store)
    tables = ("jobs", "events", "points", "results", "models", "artefacts")
    assert all(2 * len(after[table]) == len(before[table]) for table in tables)
    assert lease.job.id not in repr(after)
    with pytest.raises(JobNotFoundError, match=lease.job.id):
        store.jobs.get(ALICE, lease.job.id)


@pytest.mark.parametrize("ask", ["get", *ALLOWED])
@pytest.mark.parametrize("state", JobState)
def test_job_of_another_owner_is_not_found_and_unchanged(store, ask, state):
    job = job_in(store, state, BOB)
    before = contents(store)
    messages = []
    for name in (job.id, UNKNOWN):
        with pytest.raises(JobNotFoundError) as raised:
            getattr(store.jobs, ask)(ALICE, name)
        messages.append(str(raised.value).replace(name, "?"))
    # The message does not reveal that the job exists.
    assert messages[0] == messages[1]
    assert contents(store) == before


def test_owner_cannot_see_data_of_another_owner(store):
    theirs = submitted(store, BOB)
    dataset, _ = store.datasets.add(BOB, "a.csv", ".csv", "1" * 64, 10, {})
    assert store.jobs.page(ALICE).jobs == ()
    assert store.jobs.page(ALICE, QUEUED, (theirs.created + 1, "f" * 32)).jobs == ()
    assert store.datasets.page(ALICE) == ((), None)
    for ask in ("get", "delete"):
        with pytest.raises(DatasetNotFoundError, match=dataset.id):
            getattr(store.datasets, ask)(ALICE, dataset.id)
    assert store.datasets.get(BOB, dataset.id) == dataset


def pages(store, owner, limit, state=None, between=lambda: None):
    """Read a list to its end, and call a function between two pages."""
    after, found = None, []
    while True:
        assert len(found) < 100, "the list has no end"
        page = store.jobs.page(owner, state, after, limit)
        found.append([job.id for job in page.jobs])
        if page.after is None:
            return found
        after = page.after
        between()


def test_list_read_during_changes_contains_every_other_job_once(store):
    jobs = [submitted(store, priority=-each) for each in range(12)]
    deleted = store.jobs.cancel(ALICE, submitted(store).id)
    events = [
        lambda: submitted(store, priority=-50),
        lambda: claimed(store),
        lambda: store.leases.finish(claimed(store), FAILED),
        lambda: store.jobs.cancel(ALICE, jobs[5].id),
        lambda: (store.jobs.delete(ALICE, deleted.id), submitted(store, priority=-50)),
    ]
    found = pages(store, ALICE, 2, between=lambda: events.pop(0)() if events else None)
    assert not events
    listed = [each for page in found for each in page]
    assert len(listed) == len(set(listed))
    assert {job.id for job in jobs} <= set(listed)
