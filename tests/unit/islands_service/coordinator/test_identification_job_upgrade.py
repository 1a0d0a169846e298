"""A data folder of the previous release: jobs are listed, results are read, a running job continues."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from sqlalchemy import MetaData, create_engine, select, update

from islands_service.coordinator import identification_job as work
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import ISLANDS_VERSION, Job, JobState, Submission
from islands_service.figure_worker import read_search_result
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import Database
from islands_service.store.migrations.upgrade import upgrade
from islands_service.store.tables import jobs
from support.job_runs import make_run
from support.stores import ALICE

Found = tuple[list[Any], list[Any]]

#: Last revision of the previous release.
PREVIOUS = "0001"


class ProcessEndedError(Exception):
    """The previous release was stopped."""


def copy_rows(source: str, target: Database) -> None:
    """Create the schema of the previous release, and copy the rows with the columns that it has."""
    reading = create_engine(source)
    with target.exclusive() as there, reading.connect() as here:
        upgrade(there, PREVIOUS)
        old, new = MetaData(), MetaData()
        old.reflect(there)
        new.reflect(here)
        for table in old.sorted_tables:
            if table.name != "alembic_version":
                columns = [new.tables[table.name].c[name] for name in table.columns.keys()]  # noqa: SIM118 - not a mapping
                if rows := [dict(row) for row in here.execute(select(*columns)).mappings()]:
                    there.execute(table.insert(), rows)
    reading.dispose()


@pytest.fixture
def previous(
    settings: ServiceSettings,
    store: Store,
    blobs: Blobs,
    job: Job,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
) -> ServiceSettings:
    """A data folder of the previous release with a finished job and a running one."""
    monkeypatch.setattr(work, "REPORT_EVERY", 0.0)
    monkeypatch.setattr(work, "CHECKPOINT_SHARE", 1e9)
    second = store.jobs.submit(Submission(ALICE, job.spec, idempotency_key="k"))[0]
    for each in (job, second):
        lease = store.leases.claim(each.id, 3600.0)
        assert lease is not None

        def stop_at_3(second: str = second.id) -> None:
            if (store.jobs.get(ALICE, second).progress or {}).get("generation", -1) >= 3:
                raise ProcessEndedError

        try:
            outcome = run_identification_job(make_run(lease, store, blobs, stop_at_3, 1e-9))
        except ProcessEndedError:
            continue
        store.leases.finish(lease, outcome)
    folder = tmp_path_factory.mktemp("previous")
    shutil.copytree(settings.blobs, folder / "blobs")
    target = Database(f"sqlite:///{folder / 'islands.db'}")
    copy_rows(settings.url, target)
    target.close()
    return ServiceSettings(data_dir=folder)


@pytest.mark.ci
def test_data_folder_of_the_previous_release_is_continued(
    previous: ServiceSettings, job: Job, undisturbed: Found
) -> None:
    assert Path(previous.data_dir, "islands.db").exists()
    blobs = Blobs(previous.blobs)
    with Store(previous.url) as store:
        listed = {each.state: each for each in store.jobs.page(ALICE).jobs}
        assert set(listed) == {JobState.SUCCEEDED, JobState.RUNNING}
        done, running = listed[JobState.SUCCEEDED], listed[JobState.RUNNING]
        assert done.id == job.id
        assert set(done.versions.values()) == {None}
        # The result, its figures and the list of data sets.
        assert [model.document for model in store.results.models(done.id)] == undisturbed[0]
        assert len(read_search_result(done, store, blobs, None).models) == len(undisturbed[0])
        (dataset,) = store.datasets.page(ALICE)[0]
        assert dataset.preview["columns"] == len(store.datasets.get(ALICE, dataset.id).preview["columns"])
        # The running job continues from its checkpoint, when the lease has expired.
        assert store.leases.claim("today", 60.0) is None
        store.database.write(lambda connection: connection.execute(update(jobs).values(lease_until=0.0)))
        lease = store.leases.claim("today", 60.0)
        assert lease is not None
        assert lease.job.id == running.id
        reached: list[int] = []

        def look() -> None:
            reached.append((store.jobs.get(ALICE, running.id).progress or {})["generation"])

        outcome = run_identification_job(make_run(lease, store, blobs, look, 1e-9))
        assert min(reached) >= 3
        store.leases.finish(lease, outcome)
        models = [json.loads(json.dumps(document)) for document, _ in outcome.models]
        assert models == undisturbed[0]
        assert store.results.history(running.id) == undisturbed[1]
        versions = store.jobs.get(ALICE, running.id).versions
        assert versions == {"job": None, "checkpoint": ISLANDS_VERSION, "result": ISLANDS_VERSION}
