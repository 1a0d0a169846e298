"""Load of a service: durable job submissions, requests of jobs, event streams.

    python -m lab.service.load [store claim accept get events owners] [--repeat 5] [--json FILE]

Results are printed, not asserted; the targets are those of the service's design. The server is `islands
serve` with SQLite, without a coordinator but for ``owners``. The clients are this process with persistent
connections: httpx for the latency of a single client, and a cheaper one for many, so that the server
dominates.
"""

import asyncio
import json
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sqlalchemy import insert

from islands.records.reading.preview import preview
from islands_service.domain.job import Job, ProgressReport, Submission
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.tables import jobs
from lab.service.table import Figure, percentile, run
from support.command_line import write_hysteresis
from support.processes import eventually
from support.service_client import SPEC
from support.service_processes import Service, serving

#: Number of concurrent clients.
CLIENTS = 16

#: Number of jobs of each concurrent client.
EACH = 60

#: Number of jobs of a single client.
ALONE = 200

#: Duration of the requests of a job in seconds.
LOOKING = 5.0

#: Number of queued jobs of a full queue, and of claims that are measured.
QUEUED, CLAIMS = 10_000, 100

#: Number of connections that request a job.
CONNECTIONS = 16

#: Number of event streams.
STREAMS = 500

#: Number of events sent to every stream.
EVENTS = 10

#: Interval between events in seconds.
EVENT_INTERVAL = 0.7

#: Without a coordinator, jobs stay in the queue.
ENVIRONMENT = {"ISLANDS_COORDINATORS": "0"}

#: Owners with small jobs, small jobs of each, and long jobs of each of two other owners.
OWNERS, SMALL, LONG = 20, 10, 5

#: Two coordinators, which run short searches themselves, as by default.
SHARED = {"ISLANDS_COORDINATORS": "2", "ISLANDS_SHORT_SEARCH": "5", "ISLANDS_CHECKPOINT_EVERY": "5"}


@contextmanager
def start_service() -> Iterator[Service]:
    with (
        tempfile.TemporaryDirectory(prefix="islands-load-") as folder,
        serving(Path(folder) / "data", environment=ENVIRONMENT) as service,
    ):
        yield service


class Connection:
    """Persistent HTTP connection. Costs a tenth of a full client, so that the server dominates."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, port: int) -> None:
        self._reader, self._writer, self._port = reader, writer, port

    @classmethod
    async def to(cls, service: Service) -> "Connection":
        port = service.client.base_url.port
        assert port is not None
        return cls(*await asyncio.open_connection("127.0.0.1", port), port)

    async def ask(self, method: str, path: str, body: bytes = b"", headers: str = "") -> tuple[int, bytes]:
        await self.send(method, path, body, headers)
        head = await self._reader.readuntil(b"\r\n\r\n")
        length = next(
            int(line.split(b":")[1])
            for line in head.split(b"\r\n")
            if line.lower().startswith(b"content-len")
        )
        return int(head.split(b" ", 2)[1]), await self._reader.readexactly(length)

    async def send(self, method: str, path: str, body: bytes = b"", headers: str = "") -> None:
        head = (
            f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1:{self._port}\r\nContent-Type: application/json\r\n"
            f"{headers}Content-Length: {len(body)}\r\n\r\n"
        )
        self._writer.write(head.encode() + body)
        await self._writer.drain()

    async def line(self) -> bytes:
        return await self._reader.readline()

    async def close(self) -> None:
        self._writer.close()
        await self._writer.wait_closed()


def body(service: Service) -> bytes:
    return json.dumps({**SPEC, "dataset": service.dataset}).encode()


async def together(count: int, each: Callable[[int], Awaitable[list[float]]]) -> tuple[list[float], float]:
    """Run an action in concurrent clients; return the duration of each call and of all."""
    began = time.perf_counter()
    taken = await asyncio.gather(*(each(number) for number in range(count)))
    return [one for some in taken for one in some], time.perf_counter() - began


async def accepted(service: Service, clients: int, jobs: int, turn: int) -> tuple[list[float], float]:
    asked = body(service)
    connections = [await Connection.to(service) for _ in range(clients)]

    async def submit(number: int) -> list[float]:
        taken = []
        for job in range(jobs):
            key = f"Idempotency-Key: {turn}-{clients}-{number}-{job}\r\n"
            began = time.perf_counter()
            status, answer = await connections[number].ask("POST", "/v1/jobs", asked, key)
            taken.append(time.perf_counter() - began)
            assert status == 202, answer
        return taken

    found = await together(clients, submit)
    for connection in connections:
        await connection.close()
    return found


def accept(repeat: int) -> Iterator[Figure]:
    """Measure submissions over HTTP, which are durable before they are acknowledged."""
    alone, slow, rate = [], [], []
    for turn in range(repeat):
        with (
            start_service() as service
        ):  # a new database each time, because every submission counts the queued jobs
            alone.append(1e3 * percentile(_submit_alone(service, turn), 0.5))
            taken, seconds = asyncio.run(accepted(service, CLIENTS, EACH, turn))
            slow.append(1e3 * percentile(taken, 0.99))
            rate.append(len(taken) / seconds)
    yield Figure("durable accept over HTTP, 1 client: p50", "ms", 3.0, tuple(alone))
    yield Figure(f"durable accept over HTTP, {CLIENTS} clients: p99", "ms", 60.0, tuple(slow))
    yield Figure(f"durable accept over HTTP, {CLIENTS} clients: rate", "1/s", 500.0, tuple(rate), most=False)


def _submit_alone(service: Service, turn: int) -> list[float]:
    """Submit jobs with httpx over one connection; return the duration of each call."""
    asked = body(service)
    taken = []
    for job in range(ALONE):
        headers = {"Content-Type": "application/json", "Idempotency-Key": f"{turn}-{job}"}
        began = time.perf_counter()
        answer = service.client.post("/v1/jobs", content=asked, headers=headers)
        taken.append(time.perf_counter() - began)
        assert answer.status_code == 202, answer.text
    return taken


def store(repeat: int) -> Iterator[Figure]:
    """Measure submissions to the store from threads."""
    alone, slow, rate = [], [], []

    def submit(opened: Store, client: int, jobs: int) -> list[float]:
        taken = []
        for job in range(jobs):
            began = time.perf_counter()
            opened.jobs.submit(Submission("me", SPEC, idempotency_key=f"{client}-{job}"), 10_000)
            taken.append(time.perf_counter() - began)
        return taken

    for _ in range(repeat):
        with tempfile.TemporaryDirectory() as folder, Store(f"sqlite:///{folder}/islands.db") as opened:
            alone.append(1e3 * percentile(submit(opened, -1, ALONE), 0.5))
            began = time.perf_counter()
            with ThreadPoolExecutor(CLIENTS) as pool:
                futures = [pool.submit(submit, opened, client, EACH) for client in range(CLIENTS)]
                taken = [one for future in futures for one in future.result()]
            rate.append(len(taken) / (time.perf_counter() - began))
            slow.append(1e3 * percentile(taken, 0.99))
    yield Figure("durable accept at the store, 1 thread: p50", "ms", None, tuple(alone))
    yield Figure(f"durable accept at the store, {CLIENTS} threads: p99", "ms", 53.0, tuple(slow))
    yield Figure(
        f"durable accept at the store, {CLIENTS} threads: rate", "1/s", 669.0, tuple(rate), most=False
    )


def claim(repeat: int) -> Iterator[Figure]:
    """Measure claims from a full queue: durable, of 50 owners in turn, by priority and age."""
    middle, slow = [], []
    spec = json.dumps(SPEC)
    with tempfile.TemporaryDirectory() as folder, Store(f"sqlite:///{folder}/islands.db") as opened:
        rows = [
            {
                "id": f"{number:032x}",
                "owner": f"owner {number % 50}",
                "kind": "identification",
                "name": "",
                "spec": spec,
                "request_sha256": "0" * 64,
                "priority": number % 3,
                "state": "queued",
                "created": float(number),
                "updated": float(number),
            }
            for number in range(QUEUED + repeat * CLAIMS)
        ]
        opened.database.write(lambda connection: connection.execute(insert(jobs), rows))
        for turn in range(repeat):
            taken = []
            for number in range(CLAIMS):
                began = time.perf_counter()
                assert opened.leases.claim(f"{turn}-{number}", 3600.0) is not None
                taken.append(time.perf_counter() - began)
            middle.append(1e3 * percentile(taken, 0.5))
            slow.append(1e3 * percentile(taken, 0.99))
    yield Figure(f"claim of {QUEUED} queued jobs: p50", "ms", 5.0, tuple(middle))
    yield Figure(f"claim of {QUEUED} queued jobs: p99", "ms", None, tuple(slow))


def get(repeat: int) -> Iterator[Figure]:
    """Measure requests of one job."""
    alone, slow, rate = [], [], []
    with start_service() as service:
        job = service.submit(5)
        for _ in range(repeat):
            alone.append(1e3 * percentile(_get_alone(service, job), 0.5))
            at, p99 = asyncio.run(_looked(service, job))
            rate.append(at)
            slow.append(p99)
    yield Figure("GET job, 1 client: p50", "ms", 3.0, tuple(alone))
    yield Figure("GET job: rate", "1/s", 1500.0, tuple(rate), most=False)
    yield Figure("GET job: p99", "ms", 50.0, tuple(slow))


def _get_alone(service: Service, job: str) -> list[float]:
    """Request a job with httpx over one connection; return the duration of each call."""
    taken = []
    for _ in range(ALONE):
        began = time.perf_counter()
        answer = service.client.get(f"/v1/jobs/{job}")
        taken.append(time.perf_counter() - began)
        assert answer.status_code == 200, answer.text
    return taken


async def _looked(service: Service, job: str) -> tuple[float, float]:
    connections = [await Connection.to(service) for _ in range(CONNECTIONS)]
    until = time.perf_counter() + LOOKING

    async def look(number: int) -> list[float]:
        taken = []
        while (began := time.perf_counter()) < until:
            status, _ = await connections[number].ask("GET", f"/v1/jobs/{job}")
            taken.append(time.perf_counter() - began)
            assert status == 200
        return taken

    taken, seconds = await together(CONNECTIONS, look)
    for connection in connections:
        await connection.close()
    return len(taken) / seconds, 1e3 * percentile(taken, 0.99)


def events(repeat: int) -> Iterator[Figure]:
    """Measure the delay of an event from the store to all streams of the job."""
    middle, slow, until_all = [], [], []
    for _ in range(repeat):
        with start_service() as service:
            job = service.submit(5)
            taken, connecting = asyncio.run(_fanned_out(service, job))
            middle.append(percentile(taken, 0.5))
            slow.append(percentile(taken, 0.99))
            until_all.append(connecting)
    yield Figure(f"{STREAMS} event streams: all connected", "s", None, tuple(until_all))
    yield Figure(f"{STREAMS} event streams: fan-out p50", "s", None, tuple(middle))
    yield Figure(f"{STREAMS} event streams: fan-out p99", "s", 0.5, tuple(slow))


async def _fanned_out(service: Service, job: str) -> tuple[list[float], float]:
    """Return the seconds from an event's commit to each stream, and the seconds until all were connected."""
    taken: list[float] = []
    sent: dict[int, float] = {}
    begun = asyncio.Semaphore(0)

    async def watch() -> None:
        connection = await Connection.to(service)
        await connection.send("GET", f"/v1/jobs/{job}/events")
        number = 0
        while line := await connection.line():
            if line.startswith(b"id: "):
                number = int(line[4:])
                if number == 1:
                    begun.release()
                elif number in sent:
                    taken.append(time.perf_counter() - sent[number])
            if line.startswith(b"event: succeeded") or number == EVENTS + 2:
                break
        await connection.close()

    began = time.perf_counter()
    watchers = [asyncio.create_task(watch()) for _ in range(STREAMS)]
    for _ in range(STREAMS):
        await begun.acquire()
    connecting = time.perf_counter() - began
    await asyncio.to_thread(_tell, service, job, sent)
    await asyncio.gather(*watchers)
    assert len(taken) == STREAMS * EVENTS, len(taken)
    return taken, connecting


def _tell(service: Service, job: str, sent: dict[int, float]) -> None:
    """Report progress like a coordinator."""
    with Store(f"sqlite:///{service.folder / 'islands.db'}") as opened:
        lease = opened.leases.claim("load", 3600.0)
        assert lease is not None
        assert lease.job.id == job
        version = lease.job.version
        for number in range(EVENTS):
            time.sleep(EVENT_INTERVAL)
            # The time is taken before the event is visible: the report returns when it is durable.
            sent[version + 1 + number] = time.perf_counter()
            opened.leases.report(lease, ProgressReport(_progress(number)))


def _progress(number: int) -> dict[str, Any]:
    return {"phase": "search", "generation": number, "best_by_size": dict.fromkeys(map(str, range(10)), 0.1)}


def owners(repeat: int) -> Iterator[Figure]:
    """Measure how long the first small job of each owner waits behind long jobs of two others."""
    found: list[list[float]] = []
    for _ in range(repeat):
        with (
            tempfile.TemporaryDirectory(prefix="islands-load-") as folder,
            serving(Path(folder) / "data", environment=SHARED) as service,
            Store(f"sqlite:///{service.folder / 'islands.db'}") as opened,
        ):
            found.append(_share(opened, Blobs(ServiceSettings(data_dir=service.folder).blobs), folder))
    yield Figure(f"first small jobs of {OWNERS} owners: longest wait", "s", 60.0, tuple(map(max, found)))
    yield Figure(f"first small jobs of {OWNERS} owners: shortest wait", "s", None, tuple(map(min, found)))


def _share(opened: Store, blobs: Blobs, folder: str) -> list[float]:
    """Return the seconds for which the first small job of each owner waits."""
    path = write_hysteresis(Path(folder) / "record.csv")
    data, described = path.read_bytes(), asdict(preview(path))
    blob = blobs.write(data)

    def submit(owner: str, generations: int, **settings: int) -> Job:
        dataset, _ = opened.datasets.add(owner, path.name, path.suffix, blob, len(data), described)
        chosen = {**SPEC["settings"], "islands": 1, "generations": generations, **settings}
        return opened.jobs.submit(Submission(owner, {**SPEC, "dataset": dataset.id, "settings": chosen}))[0]

    def read(job: Job) -> Job:
        return opened.jobs.get(job.owner, job.id)

    long = [submit(f"long {place}", 100_000, population=100) for place in (0, 1) for _ in range(LONG)]
    eventually(lambda: sum(read(job).checkpoint is not None for job in long) == 2, seconds=300.0)
    names = [f"small {place}" for place in range(OWNERS)]
    small = [submit(name, 2) for _ in range(SMALL) for name in names]
    eventually(lambda: all(read(job).started for job in small[:OWNERS]), seconds=600.0)
    return [job.started - job.created for job in map(read, small[:OWNERS]) if job.started]


MEASURES = {"store": store, "claim": claim, "accept": accept, "get": get, "events": events, "owners": owners}

if __name__ == "__main__":
    sys.exit(run(MEASURES, __doc__))  # type: ignore[arg-type]
