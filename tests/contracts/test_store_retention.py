"""Retention of data sets: the time begins when no job names one, and what a job needs is kept."""

from typing import Any

import pytest
from sqlalchemy import select, update

from islands_service.domain.job import DatasetDeletedError, JobState, Submission
from islands_service.store import Store
from islands_service.store.datasets import DatasetNotFoundError
from islands_service.store.tables import datasets
from support.service import spec
from support.stores import ALICE, BLOB, BOB, job_in

#: Retention of the tests in seconds.
DAY = 86_400


def added(store: Store, owner: str = ALICE, blob: str = BLOB) -> str:
    return store.datasets.add(owner, "a.csv", ".csv", blob, 12, {"columns": []})[0].id


def pass_time(store: Store, seconds: float) -> None:
    """Let all data sets have been idle for longer."""
    older = update(datasets).values(idle_since=datasets.c.idle_since - seconds)
    store.database.write(lambda connection: connection.execute(older))


def rows(store: Store) -> list[Any]:
    with store.database.read() as connection:
        return list(connection.execute(select(datasets)))


def listed(store: Store, owner: str = ALICE) -> list[str]:
    return [dataset.id for dataset in store.datasets.page(owner)[0]]


def test_an_idle_data_set_expires_after_its_time_which_begins_with_a_sweep(store: Store) -> None:
    dataset = added(store)
    pass_time(store, 10 * DAY)
    assert store.retention.expire_datasets(DAY) == 0
    since = store.datasets.get(ALICE, dataset).idle_since
    assert since is not None
    pass_time(store, DAY - 60)
    assert store.retention.expire_datasets(DAY) == 0
    assert store.datasets.get(ALICE, dataset).idle_since == pytest.approx(since - DAY + 60)
    pass_time(store, 61)
    assert store.retention.expire_datasets(DAY) == 1
    assert not listed(store)
    with pytest.raises(DatasetNotFoundError):
        store.datasets.get(ALICE, dataset)
    (entry,) = store.audit.entries(ALICE, limit=1)
    assert (entry.action, entry.subject, entry.key_id, entry.address) == (
        *("expire-dataset", dataset, None),
        "retention",
    )
    assert len(rows(store)) == 1
    assert store.retention.expire_datasets(DAY) == 0
    assert not rows(store)
    assert len(store.audit.entries(ALICE)) == 1


@pytest.mark.parametrize("state", [JobState.QUEUED, JobState.SUCCEEDED, JobState.FAILED])
def test_a_data_set_that_a_job_names_is_kept_and_its_time_begins_after_the_job(
    store: Store, state: JobState
) -> None:
    dataset = added(store)
    store.retention.expire_datasets(DAY)
    job = job_in(store, state, ALICE, spec=spec(dataset))
    for _ in range(2):
        pass_time(store, 2 * DAY)
        assert store.retention.expire_datasets(DAY) == 0
    assert store.datasets.get(ALICE, dataset).idle_since is None
    if state == JobState.QUEUED:
        store.jobs.cancel(ALICE, job.id)
    store.jobs.delete(ALICE, job.id)
    store.retention.expire_datasets(DAY)
    assert listed(store) == [dataset]
    pass_time(store, DAY + 1)
    assert store.retention.expire_datasets(DAY) == 1


def test_validation_data_and_recordings_are_named_too(store: Store) -> None:
    used = [added(store, blob=str(number) * 64) for number in range(3)]
    named = {
        **spec(used[0]),
        "recordings": [{"dataset": used[1]}],
        "validation": {"dataset": used[2], "rows": "0:9"},
    }
    job_in(store, JobState.SUCCEEDED, ALICE, spec=named)
    for _ in range(2):
        assert store.retention.expire_datasets(DAY) == 0
        pass_time(store, 2 * DAY)
    assert len(listed(store)) == 3


def test_a_job_that_is_submitted_while_the_data_set_expires_can_read_it(store: Store) -> None:
    dataset = added(store)
    store.retention.expire_datasets(DAY)
    pass_time(store, DAY + 1)
    store.retention.expire_datasets(DAY)
    # The submission was validated before.
    job = store.jobs.submit(Submission(ALICE, spec(dataset)))[0]
    store.retention.expire_datasets(DAY)
    assert store.datasets.get(ALICE, job.datasets[0], deleted=True).blob == BLOB
    store.jobs.cancel(ALICE, job.id)
    with pytest.raises(DatasetDeletedError):
        store.jobs.resume(ALICE, job.id)


def test_the_retention_of_an_owner_precedes_the_default(store: Store) -> None:
    kept, short = added(store), added(store, BOB)
    store.owners.change(ALICE, {"dataset_retention": 0})
    store.owners.change(BOB, {"dataset_retention": 100})
    for default in (DAY, 0):
        store.retention.expire_datasets(default)
        pass_time(store, 101)
    assert store.retention.expire_datasets(DAY) == 0
    assert (listed(store), listed(store, BOB)) == ([kept], [])
    assert store.datasets.get(ALICE, kept).idle_since is None
    assert short


def test_without_a_retention_nothing_expires_and_a_later_one_begins_then(store: Store) -> None:
    dataset = added(store)
    store.retention.expire_datasets(DAY)
    pass_time(store, 10 * DAY)
    store.retention.expire_datasets(0)
    assert store.retention.expire_datasets(DAY) == 0
    assert listed(store) == [dataset]
