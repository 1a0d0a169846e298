"""Contract of the store with clients that submit: durability, idempotency keys and quotas.

Every test of the files `test_store*.py` runs on SQLite and on PostgreSQL.
"""

from functools import partial

import pytest

from islands_service.domain.job import (
    IdempotencyError,
    JobDeletedError,
    JobState,
    QuotaError,
)
from support.stores import (
    ALICE,
    BOB,
    MANY,
    asked,
    at_once,
    contents,
    job_in,
    open_stores,
    submitted,
)


def test_floats_are_stored_bit_for_bit(store):
    spec = {"values": [0.1, 1 / 3, 5e-324, 1.7976931348623157e308, -0.0]}
    job = submitted(store, spec=spec)
    assert repr(store.jobs.get(ALICE, job.id).spec) == repr(spec)


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


@pytest.mark.parametrize("quota", [1, 7])
def test_concurrent_requests_get_exactly_the_quota(database, quota):
    with open_stores(database) as stores:
        answers = at_once(
            [lambda store=stores[i % 4]: store.jobs.submit(asked(), quota) for i in range(MANY)]
        )
        refused = [answer for answer in answers if isinstance(answer, QuotaError)]
        assert len(refused) == MANY - quota
        assert len(stores[0].jobs.page(ALICE).jobs) == quota
