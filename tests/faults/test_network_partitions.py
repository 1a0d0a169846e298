"""Three Ray nodes in network namespaces: partitions, the loss of a node and the loss of the head."""

import secrets
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from support.hosts import Host, hosts
from support.processes import alive, eventually
from support.service_client import TERMINAL
from support.service_processes import Service, serving

pytestmark = [pytest.mark.nightly, pytest.mark.timeout(600)]

#: Generations of a job of some seconds.
LONG = 600

#: Health checks of the head as in docs/how-to/deploy-the-service.md: the loss of a node is noticed after four
#: seconds.
HEALTH = {
    "RAY_health_check_initial_delay_ms": "1000",
    "RAY_health_check_period_ms": "500",
    "RAY_health_check_timeout_ms": "1000",
    "RAY_health_check_failure_threshold": "4",
    "RAY_kill_worker_timeout_milliseconds": "500",
    "RAY_gcs_rpc_server_reconnect_timeout_s": "5",
}

PORT = 6379

#: Longest time in seconds of a start of a node, and until a node has joined again: it ends first, and is then
#: started. On a busy machine Ray gives up a start after half a minute, and the next one succeeds.
STARTED, REJOINED = 180.0, 240.0

#: Longest time in seconds of a job.
PATIENCE = 300.0

#: Starts a node again whenever it has ended, as systemd and Kubernetes do.
RESTARTED = 'while :; do "$0" "$@"; sleep 0.5; done'


class Cluster:
    """Ray nodes on hosts, the first of which is the head without CPUs, and a service on the head's host."""

    def __init__(self, made: list[Host], folder: Path, logs: Path, environment: dict[str, str]) -> None:
        self.head, *self.workers = made
        self._folder, self._logs, self._environment = folder, logs, environment
        self.service: Service

    def start(self, host: Host) -> None:
        """Start the Ray node of a host."""
        options = ["--block", "--disable-usage-stats", "--object-store-memory", "100000000"]
        options += ["--node-ip-address", host.address]
        if host is self.head:
            options += ["--head", "--port", str(PORT), "--num-cpus", "0", "--include-dashboard", "false"]
            options += ["--temp-dir", str(self._folder)]
        else:
            options += ["--address", f"{self.head.address}:{PORT}", "--num-cpus", "1"]
        ray = str(Path(sys.executable).with_name("ray"))
        command = ["bash", "-c", RESTARTED, ray, "start", *options]
        host.start(command, self._environment, self._logs / f"{host.address}.log")

    def has_started(self, host: Host) -> bool:
        return "Ray runtime started" in (self._logs / f"{host.address}.log").read_text()

    def islands(self, host: Host) -> list[int]:
        """Return the island actors of a host."""
        return [pid for pid in host.running() if "IslandActor" in _command(pid)]

    def both_compute(self) -> bool:
        return all(map(self.islands, self.workers))


def _command(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text()
    except OSError:
        return ""


@contextmanager
def _cluster(folder: Path, logs: Path) -> Iterator[Cluster]:
    token = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(16)}
    environment = {**HEALTH, **token}
    with hosts(3) as made:
        cluster = Cluster(made, folder, logs, environment)
        for host in made:
            cluster.start(host)
            eventually(lambda: cluster.has_started(host), STARTED)  # noqa: B023
        with (
            cluster.head.entered(),
            serving(
                logs / "data", "--ray-address", f"{cluster.head.address}:{PORT}", environment=environment
            ) as cluster.service,
        ):
            yield cluster


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    # A short path: that of a socket may have 107 characters.
    with (
        tempfile.TemporaryDirectory(prefix="islands-", ignore_cleanup_errors=True) as folder,
        _cluster(Path(folder), tmp_path_factory.mktemp("cluster")) as running,
    ):
        yield running


@pytest.fixture(scope="module")
def undisturbed(cluster: Cluster) -> bytes:
    return cluster.service.found(cluster.service.submit(LONG), PATIENCE)


@pytest.fixture
def job(cluster: Cluster, undisturbed: bytes) -> str:
    """A job that computes on both workers."""
    return submit_to_both(cluster)


def submit_to_both(cluster: Cluster) -> str:
    """Submit jobs until one computes on both workers; a node that was lost may still be starting."""
    service, until = cluster.service, time.monotonic() + REJOINED
    while True:
        job = service.submit(LONG, key=secrets.token_hex(8))
        eventually(lambda: cluster.both_compute() or service.job(job)["state"] in TERMINAL, REJOINED)  # noqa: B023
        if service.job(job)["state"] not in TERMINAL and service.under_way(job) < LONG // 2:
            return job
        assert time.monotonic() < until, "no job has computed on both workers"


def progress_after(service: Service, job: str, seconds: float) -> float:
    """Return the time until a job has progressed beyond what was under way, at most some seconds."""
    began, generation = time.monotonic(), service.generation(job)
    eventually(
        lambda: service.job(job)["state"] != "running" or service.generation(job) > generation + 20, seconds
    )
    return time.monotonic() - began


@pytest.mark.parametrize("seconds", [1.5, 15.0], ids=["short", "long"])
def test_partition_of_a_worker_delays_a_job_only(
    cluster: Cluster, undisturbed: bytes, job: str, seconds: float
) -> None:
    """A long one outlasts the health checks: Ray gives the node up, and it joins again afterwards."""
    service, worker = cluster.service, cluster.workers[1]
    worker.connect(False)
    began = time.monotonic()
    try:
        taken = progress_after(service, job, 30.0)
        time.sleep(max(0.0, began + seconds - time.monotonic()))
    finally:
        worker.connect(True)
    assert service.found(job, PATIENCE) == undisturbed
    assert service.job(job)["attempt"] == 1
    print(f"partition of {seconds} s: progress after {taken:.1f} s")
    # The worker is used again.
    assert service.found(submit_to_both(cluster), PATIENCE) == undisturbed


def test_loss_of_a_worker_delays_a_job_only(cluster: Cluster, undisturbed: bytes, job: str) -> None:
    service, worker = cluster.service, cluster.workers[0]
    worker.lose()
    taken = progress_after(service, job, 30.0)
    cluster.start(worker)
    assert service.found(job, PATIENCE) == undisturbed
    assert service.job(job)["attempt"] == 1
    print(f"loss of a node: progress after {taken:.1f} s")


def test_partition_of_the_head_from_its_workers_interrupts_a_job_only(
    cluster: Cluster, undisturbed: bytes, job: str
) -> None:
    cluster.head.connect(False)
    time.sleep(15.0)
    cluster.head.connect(True)
    taken = progress_after(cluster.service, job, 60.0)
    assert cluster.service.found(job, PATIENCE) == undisturbed
    print(f"partition of the head: progress {taken:.1f} s after its end")


def test_loss_of_the_head_interrupts_a_job_only(cluster: Cluster, undisturbed: bytes, job: str) -> None:
    """The service runs on the machine of the head, and its processes survive."""
    service, head = cluster.service, cluster.head
    coordinator = service.one("coordinator")
    began = time.monotonic()
    head.lose()
    eventually(lambda: not alive([coordinator]), 90.0)
    exited = time.monotonic() - began
    cluster.start(head)
    assert service.found(job, PATIENCE) == undisturbed
    assert service.job(job)["attempt"] == 2
    print(f"head lost: the coordinator exits after {exited:.1f} s, result {time.monotonic() - began:.1f} s")
