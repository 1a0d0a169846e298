"""Contract of the store for data sets, keys and retention."""

from functools import partial
from hashlib import sha256

import pytest
from sqlalchemy import update

from islands.errors import SettingsError
from islands_service.domain.job import TERMINAL, DatasetDeletedError, JobState, QuotaError
from islands_service.store import retention
from islands_service.store.datasets import DatasetInUseError, DatasetNotFoundError, dataset_id
from islands_service.store.keys import PREFIX, SCOPES
from islands_service.store.tables import datasets, jobs
from support.stores import (
    ALICE,
    BLOB,
    BOB,
    CANCELLED,
    FAILED,
    FOUND,
    LONG,
    MANY,
    at_once,
    brought_on,
    claimed,
    commits,
    contents,
    job_in,
    open_stores,
    submitted,
)

PREVIEW = {"columns": [{"name": "u µ", "unit": "V", "mean": 0.1}], "warnings": []}
READ = frozenset({"read"})


def blob(number):
    return sha256(b"%d" % number).hexdigest()


def added(store, owner=ALICE, number=0, size=1000, **limits):
    return store.datasets.add(owner, f"{number}.csv", ".csv", blob(number), size, PREVIEW, **limits)


def test_same_bytes_in_the_same_format_are_the_same_data_set(store):
    dataset, _ = store.datasets.add(ALICE, "a.csv", ".csv", BLOB, 12, PREVIEW)
    before = contents(store)
    assert store.datasets.add(ALICE, "other.csv", ".csv", BLOB, 12, {"other": 1}) == (dataset, False)
    assert contents(store) == before
    other, new = store.datasets.add(ALICE, "a.npz", ".npz", BLOB, 12, PREVIEW)
    assert new
    assert other.id != dataset.id
    changed, new = store.datasets.add(ALICE, "a.csv", ".csv", "c" * 64, 12, PREVIEW)
    assert new
    assert changed.id != dataset.id


def test_owners_of_the_same_bytes_have_separate_data_sets(store):
    (mine, _), (theirs, new) = added(store, ALICE), added(store, BOB)
    assert new
    assert mine.id == theirs.id
    store.datasets.delete(ALICE, mine.id)
    assert store.datasets.get(BOB, theirs.id) == theirs


def test_data_sets_of_an_owner_are_limited_in_size(store):
    added(store, ALICE, 1, 600, most_bytes=1000)
    added(store, BOB, 1, 600, most_bytes=1000)
    before = contents(store)
    with pytest.raises(QuotaError, match=r"0\.0 MB is the most"):
        added(store, ALICE, 2, 401, most_bytes=1000)
    assert contents(store) == before
    assert added(store, ALICE, 3, 400, most_bytes=1000)[1]
    # An existing data set needs no further space.
    assert not added(store, ALICE, 3, 400, most_bytes=1000)[1]


def test_concurrent_uploads_get_exactly_the_allowed_bytes(database):
    with open_stores(database) as stores:
        answers = at_once([partial(added, stores[i % 4], ALICE, i, 100, most_bytes=550) for i in range(MANY)])
        assert sum(isinstance(answer, QuotaError) for answer in answers) == MANY - 5
        assert len(stores[0].datasets.page(ALICE)[0]) == 5


def test_pages_of_data_sets_are_newest_first_and_hold_each_once(store):
    made = [added(store, number=number)[0] for number in range(7)]
    for moment in (None, 2.5):
        if moment is not None:
            store.database.write(lambda connection: connection.execute(update(datasets).values(created=2.5)))
            made = [store.datasets.get(ALICE, each.id) for each in made]
        expected = sorted(made, key=lambda each: (each.created, each.id), reverse=True)
        for limit in (1, 3, 7, 8):
            found, after = [], None
            while True:
                page, after = store.datasets.page(ALICE, after, limit)
                assert len(page) <= limit
                found += page
                if after is None:
                    break
            assert [each.id for each in found] == [each.id for each in expected]
    assert store.datasets.page(BOB) == ((), None)


@pytest.mark.parametrize("state", JobState)
def test_data_set_can_be_deleted_unless_an_unfinished_job_needs_it(store, state):
    dataset, _ = added(store)
    other, _ = added(store, number=1)
    job = job_in(store, state, spec={"recordings": [{"dataset": dataset.id}]})
    before = contents(store)
    if state in TERMINAL:
        store.datasets.delete(ALICE, dataset.id)
        for ask in (store.datasets.get, store.datasets.delete):
            with pytest.raises(DatasetNotFoundError, match=dataset.id):
                ask(ALICE, dataset.id)
        # The figures of the job need it.
        assert store.datasets.get(ALICE, dataset.id, deleted=True) == dataset
        assert dataset.blob in store.retention.named_blobs()
    else:
        with pytest.raises(DatasetInUseError, match=f"{job.id} needs"):
            store.datasets.delete(ALICE, dataset.id)
        assert contents(store) == before
    store.datasets.delete(ALICE, other.id)
    assert other.blob not in store.retention.named_blobs()
    left = [each.id for each in store.datasets.page(ALICE)[0]]
    assert left == ([] if state in TERMINAL else [dataset.id])


@pytest.mark.parametrize("by", ["owner", "retention"])
def test_deleted_data_set_is_kept_and_counted_until_its_last_job_is_deleted(store, by):
    dataset, _ = added(store, size=600)
    jobs_of_it = [job_in(store, JobState.SUCCEEDED, spec={"dataset": dataset.id}) for _ in range(2)]
    store.datasets.delete(ALICE, dataset.id)
    with pytest.raises(QuotaError, match="results still need"):
        added(store, number=1, size=500, most_bytes=1000)
    if by == "owner":
        store.jobs.delete(ALICE, jobs_of_it[0].id)
        assert dataset.blob in store.retention.named_blobs()
        store.jobs.delete(ALICE, jobs_of_it[1].id)
    else:
        store.retention.delete_expired(-1.0)
    assert not contents(store)["datasets"]
    assert added(store, number=1, size=500, most_bytes=1000)[1]


def test_deleted_data_set_is_restored_by_the_same_upload(store):
    dataset, _ = added(store, size=600)
    job_in(store, JobState.SUCCEEDED, spec={"dataset": dataset.id})
    store.datasets.delete(ALICE, dataset.id)
    again, new = added(store, size=600, most_bytes=600)
    assert (again.id, new) == (dataset.id, True)
    assert [each.id for each in store.datasets.page(ALICE)[0]] == [dataset.id]
    assert not added(store)[1]


def test_job_without_its_data_set_is_not_resumed(store):
    first, second = (added(store, number=number)[0] for number in range(2))
    spec = {"dataset": first.id, "recordings": [{"dataset": second.id}], "validation": 0.25}
    job = job_in(store, JobState.FAILED, spec=spec)
    assert job.datasets == (first.id, second.id)
    store.datasets.delete(ALICE, second.id)
    before = contents(store)
    with pytest.raises(DatasetDeletedError, match=f"{second.id} .* upload the same file again"):
        store.jobs.resume(ALICE, job.id)
    assert contents(store) == before
    added(store, number=1)
    assert store.jobs.resume(ALICE, job.id).state == JobState.QUEUED


def test_job_of_another_owner_does_not_block_a_deletion(store):
    dataset, _ = added(store, ALICE)
    added(store, BOB)
    submitted(store, BOB, spec={"dataset": dataset.id})
    store.datasets.delete(ALICE, dataset.id)


def test_key_is_found_only_by_its_secret(store):
    key, secret = store.keys.create("laptop", frozenset(SCOPES), ALICE)
    assert store.keys.find(secret) == key
    assert (key.owner, key.name, key.scopes) == (ALICE, "laptop", frozenset(SCOPES))
    assert (key.expires, key.revoked, key.expired) == (None, None, False)
    for wrong in (secret[:-1], secret + "a", secret.swapcase(), "", PREFIX, key.id):
        assert store.keys.find(wrong) is None


@pytest.mark.parametrize("scopes", [frozenset(), frozenset({"read", "rule"})])
def test_key_with_an_unknown_scope_is_refused(store, scopes):
    with pytest.raises(SettingsError, match="take some of read, write, metrics"):
        store.keys.create("laptop", scopes)
    assert store.keys.all() == ()


def test_key_expires(store):
    lasting, secret = store.keys.create("a", READ, seconds=LONG)
    over, old = store.keys.create("b", READ, seconds=-1.0)
    assert (lasting.expired, over.expired) == (False, True)
    assert lasting.expires == pytest.approx(lasting.created + LONG, abs=0.1)
    assert (store.keys.find(secret).expired, store.keys.find(old).expired) == (False, True)


def test_expired_and_revoked_keys_are_not_valid(store):
    assert not store.keys.any_valid()
    store.keys.create("expired", READ, seconds=-1.0)
    key, _ = store.keys.create("revoked", READ)
    assert store.keys.any_valid()
    store.keys.revoke(key.id)
    assert not store.keys.any_valid()
    store.keys.create("lasting", READ, seconds=LONG)
    assert store.keys.any_valid()


def test_only_jobs_finished_long_ago_are_deleted(store):
    old = {state: job_in(store, state).id for state in TERMINAL}
    fresh = {state: job_in(store, state).id for state in (*TERMINAL, JobState.RUNNING)}
    waiting = submitted(store)
    key, _ = store.keys.create("a", READ)
    dataset, _ = added(store)

    def age(connection):
        ago = update(jobs).values(created=jobs.c.created - LONG, updated=jobs.c.updated - LONG)
        connection.execute(ago)
        connection.execute(
            update(jobs).where(jobs.c.id.in_(old.values())).values(finished=jobs.c.finished - LONG)
        )

    store.database.write(age)
    assert store.retention.delete_expired(2 * LONG) == 0
    assert store.retention.delete_expired(LONG - 60) == 3
    left = {job.id for job in store.jobs.page(ALICE).jobs}
    assert left == {*fresh.values(), waiting.id}
    assert not {row[0] for row in contents(store)["models"]} & set(old.values())
    assert store.keys.all() == (key,)
    assert store.datasets.get(ALICE, dataset.id) == dataset


def test_many_expired_rows_are_deleted_in_short_transactions(store, monkeypatch):
    """A heartbeat waits for the transaction before it, and must not wait for longer than a lease."""
    monkeypatch.setattr(retention, "JOBS_AT_ONCE", 2)
    monkeypatch.setattr(retention, "ENTRIES_AT_ONCE", 2)
    for _ in range(5):
        job_in(store, JobState.SUCCEEDED)
    entries = len(store.audit.entries())
    with commits(store) as times:
        assert store.retention.delete_expired(-LONG) == 5
        store.retention.delete_old_audit(-LONG)
    assert len(times) == 3 + 1 + entries // 2 + 1
    assert store.jobs.page(ALICE).jobs == ()
    assert store.audit.entries() == ()


def test_blobs_are_referenced_as_long_as_a_row_needs_them(store):
    assert store.retention.named_blobs() == frozenset()
    added(store, number=1)
    added(store, BOB, number=1)
    ends = {}
    for generation, outcome in enumerate((FOUND, FAILED, CANCELLED), start=10):
        submitted(store)
        lease = claimed(store)
        store.leases.report(lease, brought_on(generation))
        store.leases.finish(lease, outcome)
        ends[outcome.state] = lease.job.id
    store.results.keep(ends[JobState.SUCCEEDED], {"a": "a" * 64, "b": "b" * 64})
    checkpoints = {brought_on(generation).checkpoint for generation in (11, 12)}
    named = {blob(1), "a" * 64, "b" * 64} | checkpoints
    assert store.retention.named_blobs() == named
    store.datasets.delete(ALICE, dataset_id(blob(1), ".csv"))
    assert store.retention.named_blobs() == named
    for job in ends.values():
        store.jobs.delete(ALICE, job)
    assert store.retention.named_blobs() == {blob(1)}
