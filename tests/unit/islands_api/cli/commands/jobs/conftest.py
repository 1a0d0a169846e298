"""Fixtures of ``islands jobs``: a service, and the command line in this process."""

import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from islands_api.cli.service import client_options
from islands_service.coordinator.identification_job import run_identification_job
from islands_service.domain.job import JobOutcome, Submission
from islands_service.store.blobs import Blobs
from support.job_runs import make_run
from support.service import FIGURES, Service, ahead, csv
from support.stores import LONG, taken

Run = Callable[..., tuple[int, str, str]]

#: Settings of a very short search.
SMALL = {"population": 10, "generations": 3, "max_terms": 3, "shooting": 50, "max_height": 3, "islands": 2}


@pytest.fixture(scope="module")
def service(serve: Any) -> Iterator[Service]:
    with serve(rate=0) as running:
        yield running


@pytest.fixture
def owner(service: Service, monkeypatch: pytest.MonkeyPatch) -> str:
    """Owner of the test; the command line has the address of the service and the owner's key."""
    key, secret = service.store.keys.create("test", frozenset({"read", "write"}))
    monkeypatch.setenv("ISLANDS_URL", service.url)
    monkeypatch.setenv("ISLANDS_KEY", secret)
    return key.owner


@pytest.fixture
def run(owner: str, monkeypatch: pytest.MonkeyPatch, command_line: Run, tmp_path: Path) -> Run:
    """Run ``islands jobs`` in a folder with ``r.csv``; return exit code, standard output and error."""
    monkeypatch.setattr(client_options, "RETRY_SECONDS", 0.2)
    (tmp_path / "r.csv").write_bytes(csv())
    return partial(command_line, "jobs")


@pytest.fixture
def in_background() -> Iterator[Callable[..., None]]:
    """Return a function that runs an action in a thread, joined at teardown."""
    with ExitStack() as stack:

        def start(action: Callable[..., Any], *arguments: Any) -> None:
            thread = threading.Thread(target=action, args=arguments)
            thread.start()
            stack.callback(thread.join)

        yield start


@pytest.fixture(scope="module")
def found(service: Service) -> JobOutcome:
    """Outcome of a small search, run by the function of the coordinator without Ray."""
    dataset = service.upload(csv(400)).json()["id"]
    columns = {"inputs": ["u_V"], "output": "y_um"}
    spec = {"dataset": dataset, **columns, "preset": "hysteresis", "settings": SMALL}
    job, _ = service.store.jobs.submit(Submission("local", spec, priority=100))
    blobs = Blobs(service.settings.blobs)
    lease = taken(service.store, job.id)
    return run_identification_job(make_run(lease, service.store, blobs, lambda: None, LONG))


@pytest.fixture
def finish(service: Service, owner: str) -> Callable[[JobOutcome], str]:
    """Return a function that makes a job with an outcome and figures."""

    def make(outcome: JobOutcome) -> str:
        job = ahead(service, owner)
        service.store.leases.finish(taken(service.store, job), outcome)
        blob = Blobs(service.settings.blobs).write(b"<svg/>")
        names = {f"{name}.svg": blob for name in FIGURES[:4]}
        service.store.results.keep(job, names | {f"1/{name}.svg": blob for name in FIGURES[4:]})
        return job

    return make


@pytest.fixture
def done(finish: Callable[[JobOutcome], str], found: JobOutcome) -> str:
    """A succeeded job with figures."""
    return finish(found)
