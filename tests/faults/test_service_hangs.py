"""Hanging processes of a service: others take over, and a resumed process does no harm."""

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from support.processes import alive, eventually
from support.service_processes import QUICK, Service, serving

pytestmark = pytest.mark.nightly

LONG = 600

#: Seconds of a lease; the supervisor kills a coordinator without heartbeats for five seconds.
LEASE = {"ISLANDS_LEASE": "2"}

#: Token that Ray requires of every client.
TOKEN = "0123456789abcdef0123456789abcdef"

#: A search that takes one CPU, so that two coordinators find one each.
ALONE = {"islands": 1}


@pytest.fixture
def stopped() -> Iterator[list[int]]:
    """Suspended processes, which are resumed after the test so that they can end."""
    pids: list[int] = []
    yield pids
    for pid in alive(pids):
        os.kill(pid, signal.SIGCONT)


def stop(pid: int, stopped: list[int]) -> None:
    stopped.append(pid)
    os.kill(pid, signal.SIGSTOP)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    environment = {**LEASE, "RAY_AUTH_TOKEN": TOKEN}
    with serving(tmp_path_factory.mktemp("hangs") / "data", environment=environment) as running:
        yield running


@pytest.fixture(scope="module")
def undisturbed(service: Service) -> bytes:
    return service.found(service.submit(LONG, settings=ALONE))


@pytest.mark.parametrize("role", ["coordinator", "gcs"])
def test_hanging_process_is_killed_and_the_job_continues(
    service: Service, undisturbed: bytes, stopped: list[int], role: str
) -> None:
    job = service.submit(LONG, settings=ALONE)
    assert service.under_way(job) < LONG
    coordinator = service.one("coordinator")
    stop(service.one(role), stopped)
    eventually(lambda: not alive([coordinator]))
    assert service.found(job) == undisturbed
    assert service.job(job)["attempt"] == 2


@contextmanager
def colleague(service: Service, name: str) -> Iterator[subprocess.Popen[bytes]]:
    """Run a coordinator without a supervisor, as on another machine."""
    environment = {
        **os.environ,
        **QUICK,
        **LEASE,
        "ISLANDS_DATA_DIR": str(service.folder),
        "RAY_AUTH_TOKEN": TOKEN,
        "RAY_AUTH_MODE": "token",
    }
    command = [sys.executable, "-m", "islands_service.coordinator", "--name", name]
    with service.log.open("a") as log, subprocess.Popen(command, env=environment, stderr=log) as process:
        try:
            yield process
        finally:
            process.send_signal(signal.SIGCONT)
            process.terminate()


def owned(service: Service, name: str) -> list[str]:
    """Return the jobs that a coordinator has leased."""
    with sqlite3.connect(f"file:{service.folder / 'islands.db'}?mode=ro", uri=True) as database:
        found = [row[0] for row in database.execute("SELECT id FROM jobs WHERE lease_owner = ?", (name,))]
    database.close()
    return found


def test_coordinator_resumed_after_a_takeover_writes_nothing(service: Service, undisturbed: bytes) -> None:
    with colleague(service, "sleepy") as sleepy:
        jobs = [service.submit(LONG, settings=ALONE) for _ in range(2)]
        (job,) = eventually(lambda: owned(service, "sleepy"))  # type: ignore[misc]
        assert service.under_way(job) < LONG
        os.kill(sleepy.pid, signal.SIGSTOP)
        began = time.monotonic()
        eventually(lambda: service.job(job)["attempt"] == 2)
        assert time.monotonic() - began > 1.0  # the lease was respected
        os.kill(sleepy.pid, signal.SIGCONT)
        assert {service.found(each) for each in jobs} == {undisturbed}
        ended = service.job(job)
        eventually(lambda: "lease lost" in service.log.read_text())
        # The coordinator runs other jobs now.
        assert service.found(service.submit(5, settings=ALONE)) != undisturbed
        assert sleepy.poll() is None
        assert service.job(job) == ended
        assert service.models(job) == undisturbed
