"""Contract of the store with concurrent writers: shared commits and separate errors."""

import threading
from contextlib import suppress

import pytest
from sqlalchemy import insert, select, text

from islands_service.domain.job import JobNotFoundError
from islands_service.store import Store
from islands_service.store.database import StoreError
from islands_service.store.job_rows import append_event, update_job
from islands_service.store.tables import keys
from support.stores import (
    ALICE,
    MANY,
    asked,
    at_once,
    commits,
    contents,
    kinds,
    one_group,
    open_stores,
    submitted,
    wait_for_queued_writes,
)


class OwnFault(Exception):  # noqa: N818
    """An error of an operation."""


def list_new_threads(before):
    """Return the threads that began since; those of earlier tests may have ended."""
    return [each for each in threading.enumerate() if each not in before]


def in_one_group(store, actions, reads=0):
    """Run calls in threads whose writes form one group; return their values or errors."""
    answers = []
    with one_group(store, len(actions) - reads):
        thread = threading.Thread(target=lambda: answers.extend(at_once(actions)))
        thread.start()
    thread.join()
    return answers


def touched(connection, job):
    append_event(connection, update_job(connection, job), "touched")


def test_writes_that_arrive_during_a_commit_share_the_next_one(store):
    with commits(store) as times:
        answers = in_one_group(store, [lambda: store.jobs.submit(asked())] * MANY)
    assert len({job.id for job, _ in answers}) == MANY
    # The commit that kept the writer busy, and that of the group.
    assert len(times) == 2


def test_failed_operation_does_not_affect_its_group(store):
    store.keys.create("a", frozenset({"read"}))
    job = submitted(store)

    def half(connection):
        touched(connection, job.id)
        raise OwnFault

    def twice(connection):
        touched(connection, job.id)
        connection.execute(insert(keys).from_select(list(keys.c), select(keys)))

    def nonsense(connection):
        touched(connection, job.id)
        connection.execute(text("SELECT * FROM nowhere"))

    before = contents(store)
    failures = [half, twice, nonsense]
    with commits(store) as times:
        answers = in_one_group(
            store,
            [
                *[lambda: store.jobs.submit(asked())] * 4,
                *[lambda each=each: store.database.write(each) for each in failures],
                lambda: store.jobs.get("unknown", job.id),
                *[lambda: store.jobs.submit(asked())] * 4,
            ],
            reads=1,
        )
    new = [answer[0].id for answer in (*answers[:4], *answers[8:])]
    assert len(times) == 2
    assert isinstance(answers[4], OwnFault)
    assert all(isinstance(answer, Exception) for answer in answers[5:7])
    assert isinstance(answers[7], JobNotFoundError)
    assert {each.id for each in store.jobs.page(ALICE).jobs} == {job.id, *new}
    after = contents(store)
    assert after["keys"] == before["keys"]
    assert kinds(store, job.id) == ["queued"]


def test_writes_are_invisible_before_their_commit(database):
    with open_stores(database, 2) as (one, other):
        job = submitted(one)
        written, seen = threading.Event(), threading.Event()

        def slow(connection):
            touched(connection, job.id)
            written.set()
            seen.wait(10)

        thread = threading.Thread(target=one.database.write, args=(slow,))
        thread.start()
        written.wait(10)
        assert kinds(other, job.id) == ["queued"]
        seen.set()
        thread.join()
        assert kinds(other, job.id) == ["queued", "touched"]


def test_closed_store_has_written_its_queue(database):
    store, answers = Store(database), []

    def close():
        wait_for_queued_writes(store, MANY)
        store.close()

    with one_group(store, MANY + 1):
        threads = [
            threading.Thread(target=lambda: answers.extend(at_once([lambda: submitted(store)] * MANY))),
            threading.Thread(target=close),
        ]
        for thread in threads:
            thread.start()
    for thread in threads:
        thread.join()
    with Store(database) as again:
        assert {job.id for job in again.jobs.page(ALICE).jobs} == {job.id for job in answers}
    assert len(answers) == MANY


def test_closed_store_raises_errors_and_keeps_no_thread(database):
    before = set(threading.enumerate())
    store = Store(database)
    job = submitted(store)
    store.close()
    assert not list_new_threads(before)
    for ask in (lambda: submitted(store), lambda: store.jobs.get(ALICE, job.id)):
        with pytest.raises(StoreError, match="closed"):
            ask()
    store.close()
    assert not list_new_threads(before)


def test_deadlocked_transactions_both_succeed(database):
    with open_stores(database, 2) as stores:
        jobs = [submitted(stores[0]).id for _ in range(2)]
        both = threading.Barrier(2)

        def touch(first, second, wait):
            def operation(connection):
                touched(connection, first)
                if wait.pop():
                    # With a single writer at a time the barrier is never reached by both.
                    with suppress(threading.BrokenBarrierError):
                        both.wait(0.5)
                touched(connection, second)

            return operation

        answers = at_once(
            [
                lambda: stores[0].database.write(touch(*jobs, [False, False, True])),
                lambda: stores[1].database.write(touch(*jobs[::-1], [False, False, True])),
            ]
        )
        assert answers == [None, None]
        for job in jobs:
            assert kinds(stores[0], job) == ["queued", "touched", "touched"]
