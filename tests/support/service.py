"""Service for tests: the application in a real server in a thread, records, and jobs in every state.

No process and no Ray is started: tests act as the coordinator on the store. The server is uvicorn on a free
loopback port, so that streams, limits and headers are those of production.
"""

import hashlib
import io
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import structlog
import uvicorn
from fastapi import FastAPI
from sqlalchemy import Connection

from islands.records.writer import write_record
from islands_api.server import HTTPServer, make_server_config, open_listener
from islands_api.web.app import create_app
from islands_api.web.auth import LOCAL_OWNER
from islands_service.domain.job import Job, Submission
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.tables import metadata

#: Timeout of requests in seconds.
PATIENCE = 30.0

#: Media type of problems.
PROBLEM = "application/problem+json"


#: Names of the figures of a job with one model.
FIGURES = ("record", "front", "convergence", "islands", "free-run", "loop", "hold", "residuals")


@dataclass(frozen=True, slots=True)
class Service:
    """Running service with its client, application, store, settings and logs."""

    url: str
    client: httpx.Client
    app: FastAPI
    store: Store
    settings: ServiceSettings
    logs: list[Any]

    @property
    def port(self) -> int:
        return int(self.url.rpartition(":")[2])

    def upload(
        self,
        content: bytes,
        name: str = "record.csv",
        headers: dict[str, str] | None = None,
        /,
        **form: Any,
    ) -> httpx.Response:
        files = {"file": (name, content)}
        return self.client.post("/v1/datasets", files=files, data=form, headers=headers)

    def submit(self, headers: dict[str, str] | None = None, /, **spec: Any) -> httpx.Response:
        return self.client.post("/v1/jobs", json=spec, headers=headers)

    def key(self, *scopes: str, **made: Any) -> dict[str, str]:
        """Create a key; return the header that sends it."""
        _, secret = self.store.keys.create("test", frozenset(scopes or ("read", "write")), **made)
        return {"Authorization": f"Bearer {secret}"}


@contextmanager
def served(folder: Path, /, **changes: Any) -> Iterator[Service]:
    """Serve a new application with a store in a folder, which may already contain ``islands.db``."""
    settings = ServiceSettings(data_dir=folder, **changes)
    folder.mkdir(exist_ok=True)
    store = Store(settings.url)
    app = create_app(settings, store)
    with (
        structlog.testing.capture_logs([structlog.contextvars.merge_contextvars]) as logs,
        listening(app, settings) as url,
        httpx.Client(base_url=url, timeout=PATIENCE, verify=False) as client,
    ):
        yield Service(url, client, app, store, settings, logs)


class _Server(HTTPServer):
    """Server with an event that is set when it listens."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.listens = threading.Event()

    async def startup(self, sockets: Any = None) -> None:
        try:
            await super().startup(sockets)
        finally:
            self.listens.set()


@contextmanager
def listening(app: FastAPI, settings: ServiceSettings) -> Iterator[str]:
    """Serve an application as in production, on a free port, and yield its URL."""
    server = _Server(make_server_config(app, settings))
    listener = open_listener("127.0.0.1", 0)
    thread = threading.Thread(target=server.run, args=([listener],))
    thread.start()
    try:
        assert server.listens.wait(PATIENCE)
        assert server.started, "the server does not start"
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        server.should_exit = True
        thread.join()


def problem_of(response: httpx.Response, status: int, kind: str) -> str:
    """Check that a response is a problem of a status and a type; return its detail."""
    assert response.headers["content-type"] == PROBLEM, (response.status_code, response.text)
    document = response.json()
    assert (response.status_code, document["type"]) == (status, f"/problems/{kind}"), document
    assert document["status"] == status
    assert document["title"]
    assert document["request_id"] == response.headers["x-request-id"]
    return str(document["detail"])


def columns(samples: int = 200) -> dict[str, np.ndarray]:
    """Make a record with a time, an input and an output that depends on it."""
    rng = np.random.default_rng(1)
    u = rng.normal(size=samples)
    y = np.zeros(samples)
    for k in range(1, samples):
        y[k] = 0.6 * y[k - 1] + 0.3 * u[k - 1]
    return {"t_s": np.arange(samples) * 0.01, "u_V": u, "y_um": y}


def csv(samples: int = 200, separator: str = ",", mark: str = ".", /, **cells: dict[int, str]) -> bytes:
    """Make a record as text; ``y_um={7: "x"}`` replaces the cell in line 7 of the file."""
    record = columns(samples)
    lines = [separator.join(record)]
    lines += [
        separator.join(f"{value:.6f}".replace(".", mark) for value in row)
        for row in zip(*(column.tolist() for column in record.values()), strict=True)
    ]
    for name, changed in cells.items():
        at = list(record).index(name)
        for line, text in changed.items():
            split = lines[line - 1].split(separator)
            split[at] = text
            lines[line - 1] = separator.join(split)
    return ("\n".join(lines) + "\n").encode()


def npz(**arrays: Any) -> bytes:
    """Make an archive of NumPy."""
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def spec(dataset: str, /, **changes: Any) -> dict[str, Any]:
    """Return a small identification request with a fixed preset, since the default takes trials."""
    return {"dataset": dataset, "inputs": ["u_V"], "output": "y_um", "preset": "hysteresis", **changes}


def held(dataset: str, /, **changes: Any) -> dict[str, Any]:
    """Return the smallest valid discrepancy request."""
    simulation = {"kind": "bouc-wen-piezo"}
    return {"dataset": dataset, "input": "u_V", "output": "y_um", "simulation": simulation, **changes}


#: Effect injected into a record of `hidden`.
HIDDEN = "thermal-drift"

#: Relative tolerances of the parameters of its simulation.
KNOWN = {"A": 0.02, "beta": 0.02, "gamma": 0.02, "dp": 0.01}


def hidden(folder: Path, seconds: float = 4.0) -> bytes:
    """Make a record of a piezo actuator with thermal drift, which its simulation does not model."""
    from lab.diagnosis.injection.measurement import inject

    found = inject([HIDDEN], np.random.default_rng(4), seconds=seconds, band=(1.0, 4.0))
    write_record(found.record, folder / "hidden.csv")
    return (folder / "hidden.csv").read_bytes()


def run_diagnosis(service: Service, content: bytes, /, **changes: Any) -> str:
    """Upload a record, submit a diagnosis and execute it in this process; return the id of the job."""
    dataset = service.upload(content).json()["id"]
    asked = held(dataset, channels=["T_K"], tolerance=KNOWN, **changes)
    job = service.client.post("/v1/discrepancies", json=asked).json()
    assert execute_diagnosis(service) == job["id"]
    return str(job["id"])


def execute_diagnosis(service: Service) -> str:
    """Execute the diagnosis that is next in the queue in this process; return the id of the job."""
    from islands_service.coordinator.diagnosis_job import run_diagnosis_job
    from support.job_runs import make_run

    lease = service.store.leases.claim("test", 600.0)
    assert lease is not None
    outcome = run_diagnosis_job(make_run(lease, service.store, Blobs(service.settings.blobs)), map_cases=map)
    service.store.leases.finish(lease, outcome)
    return lease.job.id


#: Settings of a search that takes a second.
QUICK = {
    "population": 20,
    "generations": 2,
    "max_terms": 3,
    "max_height": 2,
    "shooting": 20,
    "swap_search": False,
    "refine": False,
}


def run_identification(service: Service, islands: int = 1) -> str:
    """Upload a record, submit an identification and execute it in this process; return the id of the job."""
    dataset = service.upload(csv(400)).json()["id"]
    job = service.submit(**identification(dataset, islands)).json()
    assert execute_identification(service) == job["id"]
    return str(job["id"])


def identification(dataset: str, islands: int = 1) -> dict[str, Any]:
    """Return the specification of an identification that takes a second."""
    return spec(dataset, preset="narx", settings={**QUICK, "islands": islands}, seed=islands)


def execute_identification(service: Service) -> str:
    """Execute the identification that is next in the queue in this process; return the id of the job."""
    from islands_service.coordinator.identification_job import run_identification_job
    from support.job_runs import make_run

    lease = service.store.leases.claim("test", 600.0)
    assert lease is not None
    outcome = run_identification_job(make_run(lease, service.store, Blobs(service.settings.blobs)))
    service.store.leases.finish(lease, outcome)
    return lease.job.id


def emptied(service: Service) -> Service:
    """Delete all rows of the store of a service."""

    def operation(connection: Connection) -> None:
        for table in reversed(metadata.sorted_tables):
            connection.execute(table.delete())

    service.store.database.write(operation)
    return service


def kept(store: Store, owner: str = LOCAL_OWNER, content: bytes = b"") -> str:
    """Store a valid data set without a file; return its id."""
    number = hashlib.sha256(owner.encode() + content).hexdigest()
    column = {"minimum": -1.0, "maximum": 1.0, "mean": 0.0, "deviation": 1.0, "problem": ""}
    preview = {
        "samples": 200,
        "columns": [
            {"name": name, "unit": name.partition("_")[2], "samples": 200, **column} for name in columns(3)
        ],
        "time": "t_s",
        "dt": 0.01,
        "warnings": [],
    }
    return store.datasets.add(owner, "record.csv", ".csv", number, 7, preview)[0].id


def queued(store: Store, owner: str = LOCAL_OWNER, **changes: Any) -> Job:
    """Submit a job directly to the store."""
    return store.jobs.submit(Submission(owner, **{"spec": spec("0-csv"), **changes}))[0]


def ahead(service: Service, owner: str, **changes: Any) -> str:
    """Submit a job with the highest priority directly to the store; return its id."""
    return queued(service.store, owner, priority=100, **changes).id


def parse_events(stream: str) -> list[tuple[int, str, dict[str, Any]]]:
    """Parse server-sent events: number, kind, data."""
    found = []
    for block in stream.split("\n\n"):
        if block and not block.startswith(":"):
            entry = dict(line.split(": ", 1) for line in block.splitlines())
            found.append((int(entry["id"]), entry["event"], json.loads(entry["data"])))
    return found
