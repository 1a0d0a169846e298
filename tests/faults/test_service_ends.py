"""Stopped services, cancelled and resumed jobs, and jobs without progress."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from support.processes import alive, descendants, eventually, kill
from support.service_processes import Service, serving

pytestmark = pytest.mark.nightly

LONG = 600


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with serving(tmp_path_factory.mktemp("ends") / "data") as running:
        yield running


@pytest.fixture(scope="module")
def undisturbed(service: Service) -> bytes:
    return service.found(service.submit(LONG))


def test_cancelled_job_ends_its_actors_and_resumes_to_the_same_result(
    service: Service, undisturbed: bytes
) -> None:
    job = service.submit(LONG)
    at = service.under_way(job)
    assert service.ask("POST", f"/v1/jobs/{job}/cancel").status_code == 202
    cancelled = service.ended(job, seconds=5.0)
    assert cancelled["state"] == "cancelled"
    assert at <= cancelled["progress"]["generation"] < LONG
    eventually(lambda: not service.pids("island"), seconds=5.0)
    # Those of the last generation, which the resumed job replaces.
    assert service.models(job) not in (b'{"items":[]}', undisturbed)
    assert service.ask("POST", f"/v1/jobs/{job}/resume").status_code == 202
    assert service.found(job) == undisturbed


def test_job_whose_checkpoint_was_lost_restarts_to_the_same_result(
    service: Service, undisturbed: bytes
) -> None:
    def list_checkpoints() -> set[Path]:
        return {path for path in service.folder.glob("blobs/??/*") if path.read_bytes()[:2] == b"\x1f\x8b"}

    others = list_checkpoints()  # a job that has ended keeps its last one
    job = service.submit(LONG)
    service.under_way(job)
    service.ask("POST", f"/v1/jobs/{job}/cancel")
    assert service.ended(job)["versions"]["checkpoint"] is not None
    checkpoints = list_checkpoints() - others
    assert 1 <= len(checkpoints) <= 2  # superseded ones are deleted
    for path in checkpoints:
        path.unlink()
    assert service.ask("POST", f"/v1/jobs/{job}/resume").status_code == 202
    assert service.found(job) == undisturbed
    assert "checkpoint was lost" in service.job(job)["summary"]["note"]


def test_job_that_repeatedly_ends_its_coordinator_fails(service: Service, undisturbed: bytes) -> None:
    job = service.submit(LONG)

    def attempt_is(number: int) -> bool:
        found = service.job(job)
        return found["state"] == "failed" or (found["state"] == "running" and found["attempt"] == number)

    for number in range(1, 6):
        eventually(lambda number=number: attempt_is(number))
        assert service.job(job)["progress"] is None or service.generation(job) == 0
        kill(service.one("coordinator"))
    failed = service.ended(job)
    assert (failed["state"], failed["attempt"]) == ("failed", 5)
    assert failed["problem"]["type"] == "no-progress"
    assert failed["problem"]["detail"].startswith("5 attempts ended without progress")
    # Other jobs are not blocked, and this one is not lost.
    assert service.found(service.submit(5)) != undisturbed
    assert service.ask("POST", f"/v1/jobs/{job}/resume").status_code == 202
    assert service.found(job) == undisturbed


def test_stopped_service_continues_its_jobs_after_the_next_start(tmp_path: Path, undisturbed: bytes) -> None:
    folder = tmp_path / "data"
    with serving(folder) as first:
        job, waiting = first.submit(LONG), first.submit(5)
        at = first.under_way(job, 50)
        children = descendants(first.process.pid)
        assert first.stop(seconds=20.0) == 0
        # All children, including actors and Ray's own processes.
        eventually(lambda: not alive(children), seconds=5.0)
    log = first.log.read_text()
    assert "job released" in log
    assert "Traceback" not in log
    with serving(folder, environment={"ISLANDS_COORDINATORS": "0"}) as api:
        kept = api.job(job)
        assert (kept["state"], kept["attempt"]) == ("queued", 0)
        assert kept["progress"]["generation"] >= at
        assert api.job(waiting)["state"] == "queued"
    with serving(folder) as second:
        eventually(lambda: second.job(job)["state"] == "running")
        # Its first report is past the progress before the stop: it continues from the checkpoint.
        events = second.ask("GET", f"/v1/jobs/{job}/events", params={}).text
        assert second.found(job) == undisturbed
        assert second.found(waiting) != undisturbed
        assert events.count("event: running") == 2


def test_ctrl_c_in_the_terminal_reaches_only_the_supervisor(tmp_path: Path) -> None:
    """The supervisor ends its children one after the other."""
    with serving(tmp_path / "data") as service:
        job = service.submit(LONG)
        service.under_way(job)
        service.process.send_signal(signal.SIGINT)
        assert service.process.wait(20.0) == 0
    assert "job released" in service.log.read_text()
