"""Faults behind the doors: a full disk and a lost database are told as such, and what was accepted stays."""

import os
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from dataclasses import replace

import httpx
import pytest
from sqlalchemy import update

from islands_api.web.routes import figures
from islands_service.store.tables import models, results
from support.databases import server
from support.disks import filled
from support.processes import eventually
from support.service import PATIENCE, csv, identified, parsed, problem_of, queued, served, spec
from support.stores import FOUND, claimed


@pytest.fixture
def disk(small_disk):
    return small_disk(6_000_000, nr_inodes=400)


def wordy(word):
    """A record of half a megabyte."""
    return csv(20_000).replace(b"y_um", word)


@pytest.mark.ci
def test_a_full_disk_is_told_and_reads_go_on_and_room_is_found_again(disk, serve):
    with serve(disk) as service:
        dataset = service.upload(csv()).json()["id"]
        job = service.submit(**spec(dataset)).json()
        filler = filled(disk)
        refused = [
            service.upload(wordy(b"y_mm")),
            *(service.submit(**spec(dataset, name="x" * 200, seed=seed)) for seed in range(300)),
        ]
        full = [answer for answer in refused if answer.status_code != 202]
        assert full[0] is refused[0]
        assert len(full) > 1
        for answer in full:
            assert "is full" in problem_of(answer, 507, "storage-full")
            assert "make room" in answer.json()["detail"]
            assert answer.headers["retry-after"] == "30"
        assert service.client.get(f"/v1/jobs/{job['id']}").json() == job
        assert service.client.get(f"/v1/datasets/{dataset}").status_code == 200
        assert service.client.get("/readyz").status_code == 200
        accepted = {answer.json()["id"] for answer in refused if answer.status_code == 202} | {job["id"]}
        filler.unlink()
        assert service.upload(wordy(b"y_mm")).status_code == 201
        answer = service.submit(**spec(dataset, seed=7))
        assert answer.status_code == 202
        listed = service.client.get("/v1/jobs", params={"limit": 200}).json()["items"]
        assert {each["id"] for each in listed} == accepted | {answer.json()["id"]}
        assert not list(service.settings.blobs.glob("*.part"))


@pytest.mark.ci
def test_no_room_for_a_figure_is_told_as_such(disk, serve):
    with serve(disk) as service:
        path = f"/v1/jobs/{identified(service)}/models/1/figures/loop.svg"
        filler = filled(disk)
        assert "make room" in problem_of(service.client.get(path), 507, "storage-full")
        filler.unlink()
        assert service.client.get(path).status_code == 200


def test_no_room_to_receive_an_upload_is_told_as_such(disk, serve, monkeypatch):
    """The framework keeps what is more than a megabyte in the system's temporary folder."""
    with serve() as service:
        monkeypatch.setattr(tempfile, "tempdir", str(disk))
        filler = filled(disk)
        detail = problem_of(service.upload(csv() + b"\n" * 2_000_000), 507, "storage-full")
        assert "make room" in detail
        filler.unlink()
        dataset = service.upload(csv()).json()["id"]
        with suppress(OSError):
            for number in range(1000):
                (disk / f"file{number}").touch()
        problem_of(service.upload(csv(100)), 507, "storage-full")
        problem_of(service.submit(**spec(dataset, rows="0:100")), 507, "storage-full")
        assert service.submit(**spec(dataset)).status_code == 202


@pytest.fixture
def postgres_of_our_own():
    with server() as own:
        yield own


@pytest.mark.ci
def test_a_database_that_goes_away_and_comes_back(tmp_path, postgres_of_our_own):
    own = postgres_of_our_own
    with served(tmp_path, database=own.url) as service:
        dataset = service.upload(csv()).json()["id"]
        job = service.submit({"Idempotency-Key": "k"}, **spec(dataset)).json()
        events = []
        watcher = threading.Thread(target=lambda: events.extend(_followed(service, job["id"])))
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


def _followed(service, job):
    """Follow a job through the outage: a stream that was open stays open."""
    with httpx.Client(base_url=service.url, timeout=PATIENCE, verify=False) as client:
        return parsed(client.get(f"/v1/jobs/{job}/events").text)


def test_postgresql_is_never_asked_for_what_it_cannot_hold(tmp_path, prepared_postgres):
    """A zero byte is an error of the database there, and a defect of ours if it gets through."""
    with served(tmp_path, database=prepared_postgres) as service:
        for path in ("/v1/jobs/%00", "/v1/datasets/%00", "/v1/jobs?cursor=WzEuMCwgImFcdTAwMDBiIl0"):
            assert service.client.get(path).status_code == 422, path


def test_text_of_strangers_is_kept_by_postgresql_as_by_sqlite(tmp_path, prepared_postgres):
    with served(tmp_path, database=prepared_postgres) as service:
        name = "Größe 😀 'quoted' \"twice\" \\ % _"
        job = queued(service.store, name=name)
        assert service.client.get(f"/v1/jobs/{job.id}").json()["name"] == name
        dataset = service.upload(csv(), "größe😀' ;%_.csv").json()
        assert dataset["name"] == "größe😀' ;%_.csv"
        for changes in ({"inputs": ["u\0V"]}, {"name": "a\0b"}, {"dataset": "a\0b"}):
            assert service.submit(**spec(dataset["id"], **changes)).status_code == 422


@pytest.fixture(scope="module")
def drawing(serve):
    """A service whose figures cannot be drawn: what stands in their way is put there by each test."""
    with serve() as running:
        yield running


def spoilt(service, table, **values):
    """Identify a record, and spoil what the store holds of it; return the path of a figure."""
    job = identified(service)
    service.store.database.write(
        lambda connection: connection.execute(update(table).where(table.c.job_id == job).values(**values))
    )
    return f"/v1/jobs/{job}/models/1/figures/loop.svg"


@pytest.mark.nightly
def test_a_figure_that_cannot_be_drawn_says_why_in_words_for_people(drawing):
    detail = problem_of(drawing.client.get(spoilt(drawing, models, file="{}")), 500, "failed")
    assert "cannot be drawn: model 1" in detail


@pytest.mark.nightly
def test_a_defect_of_drawing_stands_in_the_log_alone_and_is_not_met_again_at_once(drawing):
    path = spoilt(drawing, results, document='{"settings": {"islands": 1}}')
    drawing.logs.clear()
    said = [problem_of(drawing.client.get(path), 500, "failed") for _ in range(2)]
    assert said[0] == said[1]
    assert said[0].endswith("cannot be drawn: the log of the service gives the reason")
    (entry,) = [each for each in drawing.logs if each["event"] == "drawing failed"]
    assert entry["reason"].endswith("KeyError: 'search'")


@pytest.mark.nightly
def test_a_lost_record_and_a_database_that_is_away_are_told_as_such_where_a_figure_is_wanted(drawing):
    path = f"/v1/jobs/{identified(drawing)}/models/1/figures/loop.svg"
    doors = drawing.app.state.islands
    gone = doors.settings.model_copy(update={"database": "sqlite:////nowhere/islands.db"})
    drawing.app.state.islands = replace(doors, settings=gone)
    try:
        answer = drawing.client.get(path)
    finally:
        drawing.app.state.islands = doors
    problem_of(answer, 503, "store-unavailable")
    assert "nowhere" not in answer.text
    (blob,) = [each for each in doors.settings.blobs.glob("??/*") if each.read_bytes() == csv(400)]
    data = blob.read_bytes()
    blob.unlink()
    answer = drawing.client.get(path)
    blob.write_bytes(data)
    problem_of(answer, 500, "no-such-blob")
    assert str(blob.parent.parent) not in answer.text


def test_a_drawing_that_takes_too_long_is_not_begun_again_at_once(drawing, monkeypatch):
    path = f"/v1/jobs/{identified(drawing)}/models/1/figures/loop.svg"
    monkeypatch.setattr(figures, "_DRAWING_TIMEOUT", 0.1)
    detail = problem_of(drawing.client.get(path), 500, "failed")
    assert "take longer than" in detail
    monkeypatch.undo()
    assert problem_of(drawing.client.get(path), 500, "failed") == detail


def test_what_could_not_be_drawn_is_tried_again_in_a_while(monkeypatch):
    failures, error = figures.FigureFailures(), figures.FigureError("no")
    monkeypatch.setattr(figures, "_MAX_FAILURES", 2)
    for job in ("a", "b", "a", "c"):
        failures.remember(job, 1, error)
    for job, rank in (("b", 1), ("a", 2), ("a", None)):
        failures.refuse(job, rank)  # forgotten, or never tried
    for job in ("a", "c"):
        with pytest.raises(figures.FigureError, match="no"):
            failures.refuse(job, 1)
    monkeypatch.setattr(figures, "_FAILURE_SECONDS", 0.0)
    failures.remember("a", 1, error)
    failures.refuse("a", 1)


@pytest.mark.nightly
def test_a_process_that_draws_may_take_only_so_much(tmp_path):
    """It reads the files of strangers, too."""
    script = (
        "import resource, sys\n"
        "from islands_service.reports import figure_worker\n"
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
    told, limits = done.stdout.splitlines()
    assert told == "there is no job 'job'"
    assert [int(each) for each in limits.split()] == [8_000_000_002, 600]
