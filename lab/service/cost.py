"""Cost of a service and of its jobs: memory, processor time, disk, database.

    python -m lab.service.cost [idle job] [--repeat 1] [--json FILE]

Measures `islands serve` with SQLite and Ray on this machine. Memory is the proportional set size of all its
processes. The jobs are those of `islands demo`, shortened: the paper's piezo record, preset `hysteresis`, two
islands of 300 individuals. Two lengths give the cost of a job and that of an individual and of a generation.
`lab/service/capacity.py` computes with these figures.
"""

import os
import sqlite3
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

from islands.records.writer import write_record
from islands.systems.catalogue import make_record
from lab.service.table import Figure, run
from support.processes import descendants, eventually
from support.service_processes import Service, serving

#: Seconds during which the processor time of an idle service is measured.
IDLE_SECONDS = 10.0

#: Numbers of generations of the two jobs.
GENERATIONS = (5, 30)

TICKS = os.sysconf("SC_CLK_TCK")


@contextmanager
def start_service() -> Iterator[Service]:
    with (
        tempfile.TemporaryDirectory(prefix="islands-cost-", ignore_cleanup_errors=True) as folder,
        serving(Path(folder) / "data", environment={"ISLANDS_CHECKPOINT_EVERY": "30"}) as service,
    ):
        # A short job waits for Ray, compiles the kernels and loads all code.
        service.found(service.submit(5))
        yield service


def measure_memory(service: Service) -> dict[int, tuple[str, float]]:
    """Return the command line and the proportional set size in MB of each process."""
    found = {}
    for pid, line in {service.process.pid: "islands serve", **descendants(service.process.pid)}.items():
        try:
            sizes = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
        except OSError:  # the process has ended
            continue
        found[pid] = line, sum(int(size.split()[1]) for size in sizes if size.startswith("Pss:")) / 1e3
    return found


class ProcessorTime:
    """Processor time of all processes of a service, since its start.

    The time of a child counts for its parent when it ends, except for the workers of Ray, which the raylet
    does not wait for: their time is kept from the last call before their end.
    """

    def __init__(self, service: Service) -> None:
        self._service = service
        self._workers: dict[int, int] = {}

    def seconds(self) -> float:
        """Return the seconds until now. Call it often while workers run."""
        total = 0
        processes = {self._service.process.pid: "", **descendants(self._service.process.pid)}
        for pid, line in processes.items():
            try:
                fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            except OSError:  # the process has ended
                continue
            own, children = (sum(map(int, fields[first : first + 2])) for first in (11, 13))
            if line.startswith("ray::"):
                self._workers[pid] = own + children
            else:
                total += own + (0 if "raylet/raylet" in line else children)
        return (total + sum(self._workers.values())) / TICKS


def database_bytes(service: Service) -> int:
    """Return the size of the database without free pages."""
    with closing(sqlite3.connect(service.folder / "islands.db")) as connection:
        pages, free, size = (
            connection.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("page_count", "freelist_count", "page_size")
        )
    return int((pages - free) * size)


def blob_bytes(service: Service) -> int:
    """Return the size of all blobs."""
    return sum(each.stat().st_size for each in (service.folder / "blobs").rglob("*") if each.is_file())


def idle(repeat: int) -> Iterator[Figure]:
    """Measure a service that waits for jobs."""
    memory, cores = [], []
    for _ in range(repeat):
        with start_service() as service:
            eventually(lambda service=service: not service.pids("island"))
            memory.append(sum(size for _, size in measure_memory(service).values()))
            processor = ProcessorTime(service)
            before = processor.seconds()
            time.sleep(IDLE_SECONDS)
            cores.append(1e3 * (processor.seconds() - before) / IDLE_SECONDS)
    yield Figure("idle service: memory of all processes", "MB", None, tuple(memory))
    yield Figure("idle service: thousandths of a core", "", None, tuple(cores))


def job(repeat: int) -> Iterator[Figure]:
    """Measure two jobs of different length."""
    found: dict[tuple[str, str], list[float]] = {}
    for _ in range(repeat):
        with start_service() as service:
            for key, value in compare_jobs(service).items():
                found.setdefault(key, []).append(value)
    for (name, unit), values in found.items():
        yield Figure(name, unit, None, tuple(values))


@dataclass(frozen=True, slots=True)
class JobCost:
    """What a job took: seconds, MB, kB."""

    individuals: float
    seconds: float
    memory: float
    actor: float
    checkpoint: float
    blobs: float
    database: float


def compare_jobs(service: Service) -> dict[tuple[str, str], float]:
    """Run the jobs; return the figures by name and unit."""
    path = service.folder.with_name("piezo.csv")
    write_record(make_record("bouc-wen-piezo", "authors", "estimation"), path)
    before = blob_bytes(service)
    answer = service.ask("POST", "/v1/datasets", files={"file": (path.name, path.read_bytes())})
    assert answer.status_code == 201, answer.text
    record = blob_bytes(service) - before
    short, long = (run_job(service, answer.json()["id"], count) for count in GENERATIONS)
    generations = GENERATIONS[1] - GENERATIONS[0]
    rate = (long.seconds - short.seconds) / (long.individuals - short.individuals)
    growth = (long.database - short.database) / generations
    return {
        ("record: blobs", "kB"): record / 1e3,
        ("CPU of 1 000 individuals", "s"): 1e3 * rate,
        ("CPU of a job in addition", "s"): short.seconds - rate * short.individuals,
        ("largest memory of all processes", "MB"): max(short.memory, long.memory),
        ("largest memory of an actor", "MB"): max(short.actor, long.actor),
        ("checkpoints of a running job, blobs", "kB"): max(short.checkpoint, long.checkpoint) / 1e3,
        ("result: blobs", "kB"): long.blobs / 1e3,
        ("database: each generation", "kB"): growth / 1e3,
        ("database: each job in addition", "kB"): (short.database - growth * GENERATIONS[0]) / 1e3,
    }


def run_job(service: Service, dataset: str, generations: int) -> JobCost:
    """Run a job to its end; return its cost."""
    settings = {"islands": 2, "generations": generations}
    spec = {
        "dataset": dataset,
        "inputs": ["u_V"],
        "output": "y_um",
        "preset": "hysteresis",
        "settings": settings,
    }
    processor = ProcessorTime(service)
    blobs, database, seconds = blob_bytes(service), database_bytes(service), processor.seconds()
    answer = service.ask("POST", "/v1/jobs", json=spec)
    assert answer.status_code == 202, answer.text
    memory = actor = checkpoint = used = 0.0
    while (document := service.job(answer.json()["id"]))["state"] in ("queued", "running"):
        sizes = measure_memory(service)
        memory = max(memory, sum(size for _, size in sizes.values()))
        actor = max([actor, *(size for line, size in sizes.values() if "IslandActor" in line)])
        checkpoint = max(checkpoint, blob_bytes(service) - blobs)
        for _ in range(5):
            used = processor.seconds() - seconds
            time.sleep(0.2)
    used = max(used, processor.seconds() - seconds)
    assert document["state"] == "succeeded", document
    return JobCost(
        document["summary"]["evaluations"],
        used,
        memory,
        actor,
        checkpoint,
        blob_bytes(service) - blobs,
        database_bytes(service) - database,
    )


MEASURES = {"idle": idle, "job": job}

if __name__ == "__main__":
    sys.exit(run(MEASURES, __doc__))  # type: ignore[arg-type]
