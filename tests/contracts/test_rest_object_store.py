"""A service with an object store: API and coordinators on different machines, and absence of the store."""

from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from islands_service.backup import create_backup, restore_backup, verify_backup
from islands_service.coordinator import main_loop as coordinator_module
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import JobOutcome, JobState, ProgressReport
from islands_service.liveness import StopRequest
from islands_service.settings import ServiceSettings
from islands_service.store import Store, cached_blobs
from islands_service.store.blobs import Blobs
from islands_service.store.cached_blobs import CachedBlobs, open_blobs
from islands_service.store.database import Database
from support.coordinators import DONE, SerialCoordinator, replace_runner
from support.object_stores import MemoryObjects
from support.processes import eventually
from support.service import Service, csv, kept, problem_of, queued
from support.stores import claimed

#: Setting that names the store of the tests.
STORE = {"blob_store": "s3://memory/prefix"}


@pytest.fixture(scope="module")
def objects() -> Iterator[MemoryObjects]:
    objects = MemoryObjects()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(cached_blobs, "ObjectStore", lambda _: objects)
        yield objects


@pytest.fixture(scope="module")
def service(serve: Any, objects: MemoryObjects) -> Iterator[Service]:
    with serve(**STORE) as service:
        yield service


@pytest.fixture
def absent(objects: MemoryObjects) -> Iterator[MemoryObjects]:
    """The store does not answer, until ``away`` is set to False."""
    objects.away = True
    yield objects
    objects.away = False


@pytest.fixture
def machine(service: Service, tmp_path: Path) -> ServiceSettings:
    """Settings of another machine with the same database and object store."""
    return ServiceSettings(data_dir=tmp_path / "machine", database=service.settings.url, lease=1.0, **STORE)


def test_a_service_without_its_object_store_is_alive_but_not_ready(
    service: Service, absent: MemoryObjects
) -> None:
    answer = service.client.get("/readyz")
    assert "object store does not answer" in problem_of(answer, 503, "object-store-unavailable")
    assert answer.headers["retry-after"] == "1"
    assert service.client.get("/healthz").status_code == 200
    assert service.client.get("/v1/jobs").status_code == 200
    absent.away = False
    assert service.client.get("/readyz").status_code == 200


@pytest.mark.ci
def test_requests_that_are_repeated_during_an_outage_are_logged_once_a_minute(
    serve: Any, objects: MemoryObjects, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the probe of readiness, and by clients that repeat an upload."""
    with serve(**STORE) as service:
        monkeypatch.setattr(objects, "away", True)
        for _ in range(4):
            assert service.client.head("/readyz").status_code == 503
            assert service.upload(csv(300)).status_code == 503
        assert service.client.get("/v1/jobs").status_code == 200
        monkeypatch.setattr(objects, "away", False)
        assert service.client.head("/readyz").status_code == 200
        assert service.upload(csv(300)).status_code == 201
    logged = [
        (entry["event"], entry.get("route"), entry.get("failures"))
        for entry in service.logs
        if entry["event"] in ("request failed", "requests succeed again")
    ]
    assert logged == [
        ("request failed", "GET /readyz", None),
        ("request failed", "POST /v1/datasets", None),
        ("requests succeed again", "GET /readyz", 4),
        ("requests succeed again", "POST /v1/datasets", 4),
    ]
    assert "/readyz" not in [entry.get("path") for entry in service.logs]


@pytest.mark.ci
def test_an_upload_without_the_object_store_stores_nothing_and_can_be_repeated(
    service: Service, absent: MemoryObjects
) -> None:
    problem_of(service.upload(csv(300)), 503, "object-store-unavailable")
    assert not service.client.get("/v1/datasets").json()["items"]
    assert not [path for path in service.settings.blobs.rglob("*") if path.is_file()]
    absent.away = False
    dataset = service.upload(csv(300))
    assert dataset.status_code == 201
    assert service.client.delete(f"/v1/datasets/{dataset.json()['id']}").status_code == 204


def test_figures_of_another_machine_are_served(service: Service, machine: ServiceSettings) -> None:
    job = queued(service.store)
    lease = service.store.leases.claim("other", 60.0)
    assert lease is not None
    blob = open_blobs(machine).write(b"<svg/>")
    service.store.leases.finish(
        lease, JobOutcome(JobState.SUCCEEDED, {"settings": {"islands": 1}}, artefacts={"front.svg": blob})
    )
    answer = service.client.get(f"/v1/jobs/{job.id}/figures/front.svg")
    assert (answer.status_code, answer.content) == (200, b"<svg/>")


@pytest.mark.ci
def test_a_job_waits_for_the_object_store_and_is_not_lost(
    service: Service, machine: ServiceSettings, absent: MemoryObjects, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The coordinator of another machine starts without the store; waiting is no attempt."""
    blobs = CachedBlobs(machine.data_dir / "api", absent, 10**9)  # type: ignore[arg-type]
    absent.away = False
    blob = blobs.write(b"record")
    absent.away = True
    read: list[bytes] = []

    def run(job: JobRun) -> JobOutcome:
        read.append(job.blobs.read(blob))
        return DONE

    replace_runner(monkeypatch, run)
    monkeypatch.setattr(coordinator_module, "OBJECT_STORE_PAUSE", 0.02)
    job = queued(service.store, spec={"dataset": kept(service.store), "inputs": ["u_V"], "output": "y_um"})
    stopping = StopRequest()
    coordinator = Thread(target=SerialCoordinator(machine, "other", stopping).run)
    coordinator.start()
    try:

        def waits() -> bool:
            events = [each.kind for each in service.store.jobs.events(job.id)]
            return events.count("queued") > 8  # more than the attempts that a job has

        eventually(waits)
        shown = service.client.get(f"/v1/jobs/{job.id}").json()
        note = (shown["progress"] or {}).get("note", "")
        assert shown["state"] in ("queued", "running")
        assert "waiting for the object store" in note
        absent.away = False
        eventually(lambda: service.store.jobs.get(job.owner, job.id).finished)
    finally:
        stopping.request()
        coordinator.join(10.0)
    ended = service.store.jobs.get(job.owner, job.id)
    assert (ended.state, ended.attempt, read) == (JobState.SUCCEEDED, 1, [b"record"])


def test_a_backup_contains_the_objects_and_is_restored_into_another_store(
    machine: ServiceSettings, prepared_sqlite: Path, tmp_path: Path
) -> None:
    (tmp_path / "islands.db").write_bytes(prepared_sqlite.read_bytes())
    backup = tmp_path / "backup"
    with Store(f"sqlite:///{tmp_path / 'islands.db'}") as store:
        queued(store)
        blob = open_blobs(machine).write(b"a checkpoint")
        store.leases.report(claimed(store), ProgressReport({}, checkpoint=blob))
        other = machine.model_copy(update={"data_dir": tmp_path / "third"})
        manifest = create_backup(store.database, open_blobs(other), backup)
    assert verify_backup(backup) == manifest
    # The same without an object store: the backup does not depend on the kind of storage either.
    for number, target in enumerate((MemoryObjects(), None)):
        folder = tmp_path / f"restored {number}"
        new = Blobs(folder) if target is None else CachedBlobs(folder, target, 10**9)  # type: ignore[arg-type]
        database = Database(f"sqlite:///{tmp_path / f'{number}.db'}")
        restore_backup(backup, database, new)
        database.close()
        if target is not None:
            assert target.objects[f"{blob[:2]}/{blob}"] == b"a checkpoint"
        assert new.read(blob) == b"a checkpoint"
