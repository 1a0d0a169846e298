"""Startup time of a service, and recovery time after a part of it is killed or hangs.

    python -m lab.service.recovery [MEASURE ...] [--repeat 5] [--json FILE]

Measures: start, cancel, api, coordinator, hung, diagnosis, island, frozen, ray, node; all of them by
default.
Results are printed, not asserted; the targets are those of the service's design.
"""

import os
import signal
import sqlite3
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import httpx

from lab.service.table import Figure, percentile, run
from support.processes import alive, descendants, eventually, kill
from support.service import KNOWN, held, hidden
from support.service_processes import ROLES, Service, serving

#: Generations of a job that does not end by itself.
ENDLESS = 100_000

#: Generations of a job of a few seconds.
LONG = 1500

#: Seconds of a record whose diagnosis takes a quarter of a minute on two cores.
DIAGNOSED = 600.0

#: Number of running jobs that are cancelled.
CANCELS = 30

#: Seconds of uptime after which the supervisor restarts a child without a delay.
PROVEN = 10.5

#: Default duration of a lease in seconds.
LEASE = 5.0

#: Upper bound of the generations that are computed ahead at the same time.
AHEAD = 20

#: Health checks of a cluster's head, as configured in `docs/how-to/deploy-the-service.md`.
HEALTH = {
    "RAY_health_check_initial_delay_ms": "1000",
    "RAY_health_check_period_ms": "500",
    "RAY_health_check_timeout_ms": "1000",
    "RAY_health_check_failure_threshold": "4",
}


@contextmanager
def service(**environment: str) -> Iterator[Service]:
    with (
        tempfile.TemporaryDirectory(prefix="islands-recovery-", ignore_cleanup_errors=True) as folder,
        serving(Path(folder) / "data", environment=environment) as running,
    ):
        yield running


def until(what: Callable[[], object], began: float, seconds: float = 120.0) -> float:
    """Return the seconds from a time until a condition is true."""
    while not what():
        assert time.monotonic() - began < seconds, "it never came true"
        time.sleep(0.005)
    return time.monotonic() - began


def warm() -> None:
    """Compile the kernels, and read all files from the disk once."""
    with service() as running:
        running.found(running.submit(5))


def start(repeat: int) -> Iterator[Figure]:
    """Measure the time from `islands serve` until jobs are accepted, and until the first generation."""
    warm()
    ready, first = [], []
    for _ in range(repeat):
        began = time.monotonic()
        with service() as running:  # it is ready when this begins
            ready.append(time.monotonic() - began)
            job = running.submit(ENDLESS)
            eventually(lambda: _reports(running, job))  # noqa: B023
            first.append(time.monotonic() - began)
            running.ask("POST", f"/v1/jobs/{job}/cancel")
    yield Figure("/readyz after `islands serve`", "s", 1.5, tuple(ready))
    yield Figure("first generation of a first job after `islands serve`", "s", 10.0, tuple(first))


def cancel(repeat: int) -> Iterator[Figure]:
    """Measure the cancellation of a running job."""
    taken = []
    with service() as running:
        for _ in range(CANCELS):
            job = running.submit(ENDLESS)
            running.under_way(job)
            began = time.monotonic()
            running.ask("POST", f"/v1/jobs/{job}/cancel")
            taken.append(until(lambda: _stored(running, "state", job) == "cancelled", began))  # noqa: B023
    yield Figure(f"cancel of {CANCELS} running jobs", "s", None, tuple(taken))
    yield Figure(f"cancel of {CANCELS} running jobs: p99", "s", 1.5, (percentile(taken, 0.99),))


def api(repeat: int) -> Iterator[Figure]:
    """Measure the time until the API answers after it was killed."""
    back = []
    with service() as running:
        for _ in range(repeat):
            time.sleep(PROVEN)
            kill(running.one("api"))
            back.append(until(lambda: _answers(running), time.monotonic()))
    yield Figure("API killed, until it answers", "s", 1.5, tuple(back))


def coordinator(repeat: int) -> Iterator[Figure]:
    """Measure the time until a job is reclaimed after its coordinator was killed."""
    yield from _reclaimed(repeat, "coordinator killed, until its job is reclaimed", 1.0, kill, 1)


def hung(repeat: int) -> Iterator[Figure]:
    """Measure the time until a job is reclaimed after its coordinator hangs."""
    for count in (1, 2):
        name = f"coordinator hung, {count} in all, until its job is reclaimed"
        yield from _reclaimed(repeat, name, LEASE + 1.0, lambda pid: os.kill(pid, signal.SIGSTOP), count)


def _reclaimed(
    repeat: int, name: str, goal: float, strike: Callable[[int], None], count: int
) -> Iterator[Figure]:
    reclaimed, going = [], []
    with service(ISLANDS_COORDINATORS=str(count)) as running:
        job = running.submit(ENDLESS, settings={"islands": 1})
        for _ in range(repeat):
            _goes_on(running, job)
            time.sleep(PROVEN)
            attempt = _stored(running, "attempt", job)
            victim = _owner(running, job)
            generation, began = running.generation(job), time.monotonic()
            strike(victim)
            reclaimed.append(until(lambda: _stored(running, "attempt", job) != attempt, began))  # noqa: B023
            going.append(until(lambda: running.generation(job) > generation, began))  # noqa: B023
            eventually(lambda: not alive([victim]))  # noqa: B023
        running.ask("POST", f"/v1/jobs/{job}/cancel")
    yield Figure(name, "s", goal, tuple(reclaimed))
    yield Figure(f"{name.partition(',')[0]}: until it has come on", "s", None, tuple(going))


def diagnosis(repeat: int) -> Iterator[Figure]:
    """Measure the delay of a diagnosis whose coordinator is killed, with and without checkpoints."""
    for name, every in (("checkpoints every 5 s", "5"), ("no checkpoints", "1e6")):
        alone, costs = [], []
        with service(ISLANDS_CHECKPOINT_EVERY=every) as running:
            _diagnose(running)  # the first run reads all files from the disk
            for _ in range(repeat):
                seconds, undisturbed = _diagnose(running)
                killed, found = _diagnose(running, seconds / 2)
                assert found == undisturbed
                alone.append(seconds)
                costs.append(killed - seconds)
        yield Figure(f"diagnosis, undisturbed, {name}", "s", None, tuple(alone))
        yield Figure(f"coordinator of a diagnosis killed at half time, {name}, cost", "s", None, tuple(costs))


def _diagnose(running: Service, kill_after: float = 0.0) -> tuple[float, object]:
    """Return the seconds and the result of a diagnosis whose coordinator may be killed."""
    files = {"file": ("hidden.csv", hidden(running.folder.parent, DIAGNOSED))}
    dataset = running.ask("POST", "/v1/datasets", files=files).json()["id"]
    request = held(dataset, channels=["T_K"], tolerance=KNOWN)
    began = time.monotonic()
    job = running.ask("POST", "/v1/discrepancies", json=request).json()["id"]
    if kill_after:
        time.sleep(kill_after)
        kill(running.one("coordinator"))
    running.ended(job)
    seconds = time.monotonic() - began
    found = running.ask("GET", f"/v1/jobs/{job}/result").json()
    del found["wall_s"]
    return seconds, found


def island(repeat: int) -> Iterator[Figure]:
    """Measure the delay of a job of some seconds by the loss of an island's process."""
    costs, same = [], []
    with service() as running:
        began = time.monotonic()
        undisturbed = running.found(running.submit(LONG))
        for _ in range(repeat):
            began = time.monotonic()
            running.found(running.submit(LONG))
            alone = time.monotonic() - began
            began = time.monotonic()
            job = running.submit(LONG)
            running.under_way(job)
            kill(running.one("island"))
            same.append(running.found(job) == undisturbed)
            costs.append(time.monotonic() - began - alone)
    assert all(same)
    # An epoch of this job takes milliseconds.
    yield Figure("island killed, cost of it (identical result)", "s", 1.0, tuple(costs))


def frozen(repeat: int) -> Iterator[Figure]:
    """Measure the delay of a job by an island's process that is frozen: at most three epochs and 5 s."""
    for length in (1, 250):
        costs, epochs = [], []
        with service() as running:
            for _ in range(repeat):
                job = running.submit(ENDLESS, settings={"migrate_every": length})
                # A report may be older than some epochs of a few generations.
                several = 3 * max(length, AHEAD)
                generation, began = running.under_way(job, 2 * length), time.monotonic()
                alone = until(lambda: running.generation(job) >= generation + several, began)  # noqa: B023
                os.kill(running.one("island"), signal.SIGSTOP)
                generation, began = running.generation(job), time.monotonic()
                until(lambda: running.generation(job) >= generation + several, began)  # noqa: B023
                costs.append(time.monotonic() - began - alone)
                epochs.append(alone * length / several)
                running.ask("POST", f"/v1/jobs/{job}/cancel")
                running.ended(job)
        epoch = sum(epochs) / repeat
        name = f"island frozen, epochs of {epoch:.2f} s, cost of it"
        yield Figure(name, "s", round(3.0 * epoch + 5.0, 1), tuple(costs))


def ray(repeat: int) -> Iterator[Figure]:
    """Measure the time until a job continues after Ray's processes were killed."""
    for role in ("head", "gcs", "raylet"):
        going = []
        with service() as running:
            job = running.submit(ENDLESS)
            for _ in range(repeat):
                _goes_on(running, job)
                time.sleep(PROVEN)
                attempt = running.job(job)["attempt"]
                began = time.monotonic()
                kill(running.one(role))
                eventually(lambda: running.job(job)["attempt"] > attempt)  # noqa: B023
                generation = running.generation(job)
                going.append(until(lambda: running.generation(job) > generation, began))  # noqa: B023
            running.ask("POST", f"/v1/jobs/{job}/cancel")
        yield Figure(f"Ray's {role} killed, until the job comes on", "s", 15.0, tuple(going))


def node(repeat: int) -> Iterator[Figure]:
    """Measure the time until a job continues after one machine of a cluster is killed or frozen."""
    with nodes() as machines, service_on(machines) as running:
        for name, goal, sign in (
            ("killed", 5.0, signal.SIGKILL),
            ("frozen, as if it were cut off", 12.0, signal.SIGSTOP),
        ):
            going = []
            for _ in range(repeat):
                job = running.submit(ENDLESS)
                lost = machines.add_node(num_cpus=1, object_store_memory=10**8)
                raylet = lost.all_processes["raylet"][0].process.pid
                eventually(lambda: any(ROLES["island"] in line for line in descendants(raylet).values()))  # noqa: B023
                _goes_on(running, job)
                processes = (raylet, *descendants(raylet))
                generation, began = running.generation(job), time.monotonic()
                for pid in processes:
                    os.kill(pid, sign)
                # What was under way between the machines when it happened comes to an end first.
                going.append(until(lambda: running.generation(job) > generation + AHEAD, began))  # noqa: B023
                running.ask("POST", f"/v1/jobs/{job}/cancel")
                running.ended(job)
                for pid in alive(processes):
                    kill(pid)
                machines.remove_node(lost, allow_graceful=False)
            yield Figure(f"one machine of two {name}, until the job comes on", "s", goal, tuple(going))


@contextmanager
def nodes() -> Iterator[Any]:
    """Start two nodes of a cluster on this machine: a head without CPUs, and a node with one CPU."""
    os.environ.update(HEALTH, RAY_AUTH_MODE="token", RAY_AUTH_TOKEN="0" * 32)
    # Only now: how its processes know each other is settled when it is imported.
    from ray.cluster_utils import Cluster

    machines = Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "object_store_memory": 10**8})
    try:
        machines.add_node(num_cpus=1, object_store_memory=10**8)
        yield machines
    finally:
        machines.shutdown()


@contextmanager
def service_on(machines: Any) -> Iterator[Service]:
    with (
        tempfile.TemporaryDirectory(prefix="islands-recovery-", ignore_cleanup_errors=True) as folder,
        serving(Path(folder) / "data", "--ray-address", machines.address) as running,
    ):
        yield running


def _goes_on(running: Service, job: str) -> None:
    generation = running.generation(job)
    eventually(lambda: running.generation(job) > generation)


def _reports(running: Service, job: str) -> bool:
    progress = running.job(job)["progress"]
    return progress is not None and progress["phase"] == "search"


def _answers(running: Service) -> bool:
    try:
        return running.client.get("/readyz").status_code == 200
    except httpx.TransportError:
        return False


def _stored(running: Service, column: str, job: str) -> object:
    """Return a column of a job from the database; requests to the API would disturb the measurement."""
    path = running.folder / "islands.db"
    with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
        return database.execute(f"SELECT {column} FROM jobs WHERE id = ?", (job,)).fetchone()[0]


def _owner(running: Service, job: str) -> int:
    """Return the process of the coordinator that has leased a job."""
    name = str(_stored(running, "lease_owner", job))
    return next(
        pid
        for pid in running.pids("coordinator")
        if name in Path(f"/proc/{pid}/cmdline").read_text().split("\0")
    )


MEASURES = {
    "start": start,
    "cancel": cancel,
    "api": api,
    "coordinator": coordinator,
    "hung": hung,
    "diagnosis": diagnosis,
    "island": island,
    "frozen": frozen,
    "ray": ray,
    "node": node,
}

if __name__ == "__main__":
    sys.exit(run(MEASURES, __doc__))  # type: ignore[arg-type]
