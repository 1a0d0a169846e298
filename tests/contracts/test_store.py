"""Contract of the store with clients that submit: durability, idempotency keys and quotas.

Every test of the files `test_store*.py` runs on SQLite and on PostgreSQL.
"""

import time
from functools import partial

import pytest

from islands_service.domain.job import (
    ACTIVE,
    TERMINAL,
    IdempotencyError,
    JobDeletedError,
    JobState,
    QuotaError,
)
from islands_service.store import Store
from support.stores import (
    ALICE,
    BOB,
    MANY,
    asked,
    at_once,
    contents,
    job_in,
    kinds,
    open_stores,
    submitted,
)


def everything(submission):
    return {name: getattr(submission, name) for name in ("owner", "spec", "kind", "name", "priority")}


def test_submitted_job_is_queued_as_requested(store):
    before = time.time()
    submission = asked(
        kind="discrepancy", name="Bühne 3", priority=-7, spec={"a": [1, 2.5, None, True, "ü"], "b": {}}
    )
    job, new = store.jobs.submit(submission)
    assert new
    assert everything(job) == everything(submission)
    assert (job.state, job.version, job.attempt, job.cancel_requested) == (JobState.QUEUED, 1, 0, False)
    assert (job.progress, job.checkpoint, job.summary, job.problem) == (None,) * 4
    assert (job.started, job.finished) == (None, None)
    assert job.created == pytest.approx(job.updated, abs=0.1)
    assert before - 1 < job.created < time.time() + 1
    assert kinds(store, job.id) == ["queued"]


def test_accepted_job_is_found_after_reopening_the_store(database):
    with Store(database) as store:
        job = submitted(store)
    with Store(database) as store:
        assert store.jobs.get(ALICE, job.id) == job


def test_floats_are_stored_bit_for_bit(store):
    spec = {"values": [0.1, 1 / 3, 5e-324, 1.7976931348623157e308, -0.0]}
    job = submitted(store, spec=spec)
    assert repr(store.jobs.get(ALICE, job.id).spec) == repr(spec)


def test_same_key_with_the_same_request_is_the_same_job(store):
    job, new = store.jobs.submit(asked(spec={"a": 1, "b": 2}, idempotency_key="k"))
    before = contents(store)
    again, new_again = store.jobs.submit(asked(spec={"b": 2, "a": 1}, idempotency_key="k"))
    assert (new, new_again) == (True, False)
    assert again == job
    assert contents(store) == before


@pytest.mark.parametrize(
    "change", [{"spec": {"seed": 8}}, {"kind": "other"}, {"name": "other"}, {"priority": 1}]
)
def test_same_key_with_another_request_is_refused(store, change):
    job = submitted(store, idempotency_key="k")
    before = contents(store)
    with pytest.raises(IdempotencyError, match=job.id):
        submitted(store, idempotency_key="k", **change)
    assert contents(store) == before


@pytest.mark.parametrize("state", JobState)
def test_key_identifies_its_job_in_every_state(store, state):
    job = job_in(store, state, idempotency_key="k")
    assert store.jobs.submit(asked(idempotency_key="k")) == (job, False)


def test_owners_have_separate_idempotency_keys(store):
    assert submitted(store, ALICE, idempotency_key="k").id != submitted(store, BOB, idempotency_key="k").id


def test_key_of_a_deleted_job_creates_no_second_job_until_it_expires(store):
    job = submitted(store, idempotency_key="k")
    store.jobs.cancel(ALICE, job.id)
    store.jobs.delete(ALICE, job.id)
    before = contents(store)
    for ask in (store.jobs.submit, store.jobs.find_replay):
        with pytest.raises(JobDeletedError, match=f"{job.id} .* take a new key"):
            ask(asked(idempotency_key="k"))
        with pytest.raises(IdempotencyError, match=job.id):
            ask(asked(idempotency_key="k", spec={"seed": 8}))
    store.retention.delete_expired(3600.0)
    assert contents(store) == before
    assert submitted(store, BOB, idempotency_key="k").id != job.id
    store.retention.delete_expired(-1.0)
    assert store.jobs.submit(asked(idempotency_key="k"))[1]


def test_concurrent_requests_with_the_same_key_get_one_job(database):
    with open_stores(database) as stores:
        for turn in range(5):
            submit = asked(idempotency_key=f"k{turn}")
            answers = at_once([partial(stores[i % 4].jobs.submit, submit) for i in range(MANY)])
            assert len({job.id for job, _ in answers}) == 1
            assert sum(new for _, new in answers) == 1
            assert len(stores[0].jobs.page(ALICE).jobs) == turn + 1


def test_different_concurrent_requests_with_one_key_get_conflicts(database):
    with open_stores(database) as stores:
        answers = at_once(
            [
                lambda store=stores[i // 2 % 4], i=i: store.jobs.submit(
                    asked(idempotency_key="k", spec={"seed": i % 2})
                )
                for i in range(MANY)
            ]
        )
        refused = [answer for answer in answers if isinstance(answer, IdempotencyError)]
        taken = [answer for answer in answers if isinstance(answer, tuple)]
        assert (len(refused), len(taken)) == (MANY // 2, MANY // 2)
        assert len({job.id for job, _ in taken}) == 1


def test_queued_and_running_jobs_count_towards_the_quota(store):
    job_in(store, JobState.RUNNING)
    submitted(store)
    before = contents(store)
    with pytest.raises(QuotaError, match="2 jobs are waiting or running, and 2 is the most"):
        store.jobs.submit(asked(), 2)
    assert contents(store) == before
    assert store.jobs.submit(asked(), 3)[1]


@pytest.mark.parametrize("state", TERMINAL)
def test_finished_jobs_do_not_count_towards_the_quota(store, state):
    assert state not in ACTIVE
    job_in(store, state)
    assert store.jobs.submit(asked(), 1)[1]


def test_resumed_job_counts_towards_the_quota(store):
    job = submitted(store)
    store.jobs.cancel(ALICE, job.id)
    other = submitted(store)
    with pytest.raises(QuotaError, match="1 jobs are waiting or running"):
        store.jobs.resume(ALICE, job.id, 1)
    assert store.jobs.get(ALICE, job.id).state == JobState.CANCELLED
    store.jobs.cancel(ALICE, other.id)
    assert store.jobs.resume(ALICE, job.id, 1).state == JobState.QUEUED


def test_replayed_request_is_answered_at_a_full_quota(store):
    job, _ = store.jobs.submit(asked(idempotency_key="k"), 1)
    assert store.jobs.submit(asked(idempotency_key="k"), 1) == (job, False)


@pytest.mark.parametrize("quota", [1, 7])
def test_concurrent_requests_get_exactly_the_quota(database, quota):
    with open_stores(database) as stores:
        answers = at_once(
            [lambda store=stores[i % 4]: store.jobs.submit(asked(), quota) for i in range(MANY)]
        )
        refused = [answer for answer in answers if isinstance(answer, QuotaError)]
        assert len(refused) == MANY - quota
        assert len(stores[0].jobs.page(ALICE).jobs) == quota
