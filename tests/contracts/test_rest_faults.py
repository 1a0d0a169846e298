"""Faults over REST: full disks, database outages and failed figures are reported and lose no accepted job."""

import os
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from dataclasses import replace
from functools import partial

import httpx
import pytest

from islands_api.web.routes import figures
from islands_service.store.blobs import Blobs
from islands_service.store.database import StorageFullError
from support.databases import server
from support.disks import filled
from support.processes import eventually
from support.service import PATIENCE, csv, parse_events, problem_of, run_identification, served, spec
from support.stores import FOUND, claimed


@pytest.fixture
def disk(small_disk):
    return small_disk(6_000_000, nr_inodes=400)


def make_large_record(word):
    """Make a record of half a megabyte."""
    return csv(20_000).replace(b"y_um", word)


@pytest.mark.ci
def test_a_full_disk_rejects_writes_until_space_is_freed(disk, serve):
    with serve(disk) as service:
        dataset = service.upload(csv()).json()["id"]
        job = service.client.get(service.submit(**spec(dataset)).headers["location"]).json()
        filler = filled(disk)
        refused = [
            service.upload(make_large_record(b"y_mm")),
            *(service.submit(**spec(dataset, name="x" * 200, seed=seed)) for seed in range(300)),
        ]
        full = [answer for answer in refused if answer.status_code != 202]
        assert full[0] is refused[0]
        assert len(full) > 1
        for answer in full:
            assert "is full" in problem_of(answer, 507, "storage-full")
            assert "free some space" in answer.json()["detail"]
            assert answer.headers["retry-after"] == "30"
        assert service.client.get(f"/v1/jobs/{job['id']}").json() == job
        assert service.client.get(f"/v1/datasets/{dataset}").status_code == 200
        problem_of(service.client.get("/readyz"), 507, "storage-full")
        accepted = {answer.json()["id"] for answer in refused if answer.status_code == 202} | {job["id"]}
        filler.unlink()
        assert service.upload(make_large_record(b"y_mm")).status_code == 201
        answer = service.submit(**spec(dataset, seed=7))
        assert answer.status_code == 202
        listed = service.client.get("/v1/jobs", params={"limit": 200}).json()["items"]
        assert {each["id"] for each in listed} == accepted | {answer.json()["id"]}
        assert not list(service.settings.blobs.glob("*.part"))


@pytest.mark.ci
def test_a_client_frees_space_of_a_full_disk(disk, serve):
    """Deletions, cancellations and revocations use a reserve, and leave it for the next ones."""
    with serve(disk) as service:
        service.store.database.reserve.fill()
        dataset = service.upload(csv()).json()["id"]
        filled(disk)
        accepted = []
        while (answer := service.submit(**spec(dataset, name="x" * 200, seed=len(accepted)))).is_success:
            accepted.append(f"/v1/jobs/{answer.json()['id']}")
        problem_of(answer, 507, "storage-full")
        for job in accepted:
            assert service.client.post(f"{job}/cancel").json()["state"] == "cancelled"
            assert service.client.delete(job).status_code == 204
        assert service.client.delete(f"/v1/datasets/{dataset}").status_code == 204


@pytest.mark.ci
def test_a_full_disk_during_an_upload_is_reported_as_such(disk, serve, monkeypatch):
    """The disk that receives bodies is full first, then that of the links to files under their names."""
    with serve() as service:
        monkeypatch.setattr(Blobs, "spool", partial(tempfile.TemporaryFile, dir=disk))
        monkeypatch.setattr(tempfile, "tempdir", str(disk))
        filler = filled(disk)
        detail = problem_of(service.upload(csv() + b"\n" * 2_000_000), 507, "storage-full")
        assert detail == StorageFullError.__doc__
        filler.unlink()
        monkeypatch.undo()
        monkeypatch.setattr(tempfile, "tempdir", str(disk))
        dataset = service.upload(csv()).json()["id"]
        with suppress(OSError):
            for number in range(1000):
                (disk / f"file{number}").touch()
        problem_of(service.upload(csv(100)), 507, "storage-full")
        problem_of(service.submit(**spec(dataset, rows="0:100")), 507, "storage-full")
        assert service.submit(**spec(dataset)).status_code == 202


@pytest.fixture
def own_postgres():
    with server() as own:
        yield own


@pytest.mark.ci
def test_the_service_survives_a_database_outage(tmp_path, own_postgres):
    own = own_postgres
    with served(tmp_path, database=own.url) as service:
        dataset = service.upload(csv()).json()["id"]
        submitted = service.submit({"Idempotency-Key": "k"}, **spec(dataset))
        job = service.client.get(submitted.headers["location"]).json()
        events = []
        watcher = threading.Thread(target=lambda: events.extend(_read_events(service, job["id"])))
        watcher.start()
        eventually(lambda: "islands_event_streams 1.0" in service.client.get("/metrics").text)
        assert service.client.get("/readyz").status_code == 200
        own.stop()
        for method, path, body in (
            ("GET", "/readyz", {}),
            ("GET", f"/v1/jobs/{job['id']}", {}),
            ("GET", "/v1/jobs", {}),
            ("GET", "/metrics", {}),
            ("POST", "/v1/jobs", {"json": spec(dataset)}),
            ("POST", f"/v1/jobs/{job['id']}/cancel", {}),
            ("DELETE", f"/v1/datasets/{dataset}", {}),
            ("POST", "/v1/datasets", {"files": {"file": ("a.csv", csv(100))}}),
        ):
            answer = service.client.request(method, path, **body)
            assert "try again" in problem_of(answer, 503, "store-unavailable"), (method, path)
            assert answer.headers["retry-after"] == "1"
        assert service.client.get("/healthz").status_code == 200
        own.start()
        eventually(lambda: service.client.get("/readyz").status_code == 200, PATIENCE)
        assert service.client.get(f"/v1/jobs/{job['id']}").json() == job
        again = service.submit({"Idempotency-Key": "k"}, **spec(dataset))
        assert (again.json()["id"], again.headers["idempotent-replayed"]) == (job["id"], "true")
        assert len(service.client.get("/v1/jobs").json()["items"]) == 1
        service.store.leases.finish(claimed(service.store), FOUND)
        watcher.join(PATIENCE)
        assert [(number, kind) for number, kind, _ in events] == [
            (1, "queued"),
            (2, "running"),
            (3, "succeeded"),
        ]


def _read_events(service, job):
    """Follow a job through an outage; an open stream stays open."""
    with httpx.Client(base_url=service.url, timeout=PATIENCE, verify=False) as client:
        return parse_events(client.get(f"/v1/jobs/{job}/events").text)


def test_text_with_zero_bytes_never_reaches_postgresql(tmp_path, prepared_postgres):
    """PostgreSQL rejects zero bytes, which would be reported as a defect of the service."""
    with served(tmp_path, database=prepared_postgres) as service:
        for path in ("/v1/jobs/%00", "/v1/datasets/%00", "/v1/jobs?cursor=WzEuMCwgImFcdTAwMDBiIl0"):
            assert service.client.get(path).status_code == 422, path


@pytest.fixture(scope="module")
def figure_service(serve):
    """A service for tests that make figures fail."""
    with serve() as running:
        yield running


@pytest.mark.nightly
def test_figures_report_a_lost_blob_and_an_unavailable_database(figure_service):
    path = f"/v1/jobs/{run_identification(figure_service)}/models/1/figures/hold.svg"
    state = figure_service.app.state.islands
    gone = state.settings.model_copy(update={"database": "sqlite:////nowhere/islands.db"})
    figure_service.app.state.islands = replace(state, settings=gone)
    try:
        answer = figure_service.client.get(path)
    finally:
        figure_service.app.state.islands = state
    problem_of(answer, 503, "store-unavailable")
    assert "nowhere" not in answer.text
    (blob,) = [each for each in state.settings.blobs.glob("??/*") if each.read_bytes() == csv(400)]
    data = blob.read_bytes()
    blob.unlink()
    answer = figure_service.client.get(path)
    blob.write_bytes(data)
    problem_of(answer, 500, "no-such-blob")
    assert str(blob.parent.parent) not in answer.text


def test_a_failed_figure_is_retried_later(monkeypatch):
    failures, error = figures.FigureFailures(), figures.FigureError("no")
    monkeypatch.setattr(figures, "_MAX_FAILURES", 2)
    for job in ("a", "b", "a", "c"):
        failures.remember(job, 1, error)
    for job, rank in (("b", 1), ("a", 2), ("a", None)):
        failures.refuse(job, rank)  # evicted, or never failed
    for job in ("a", "c"):
        with pytest.raises(figures.FigureError, match="no"):
            failures.refuse(job, 1)
    monkeypatch.setattr(figures, "_FAILURE_SECONDS", 0.0)
    failures.remember("a", 1, error)
    failures.refuse("a", 1)


@pytest.mark.nightly
def test_the_figure_process_has_memory_and_cpu_limits(tmp_path):
    """The process reads untrusted files."""
    script = (
        "import resource, sys\n"
        "from islands_service import figure_worker\n"
        "sys.argv = ['figure_worker', 'job', '--owner', 'local']\n"
        "assert figure_worker.main() == 22\n"
        "print(resource.getrlimit(resource.RLIMIT_AS)[0], resource.getrlimit(resource.RLIMIT_CPU)[0])\n"
    )
    environment = {
        **os.environ,
        "ISLANDS_DATA_DIR": str(tmp_path),
        "ISLANDS_DATABASE": "",
        "ISLANDS_INSPECTION_MEMORY": "1",
    }
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    message, limits = done.stdout.splitlines()
    assert message == "there is no job 'job'"
    assert [int(each) for each in limits.split()] == [8_000_000_002, 600]
