"""`Heartbeat`: renews a lease, and reports cancel requests, stop requests and lost leases."""

import os
import subprocess
import sys
import time
from threading import Event
from typing import Any

import pytest

from islands_service.coordinator import heartbeat as heartbeats
from islands_service.coordinator.heartbeat import (
    Heartbeat,
    JobCancelled,
    RunTimeLimitError,
)
from islands_service.domain.job import JobOutcome, JobState, Lease, LeaseLostError, Renewal
from islands_service.liveness import StopRequest
from islands_service.store import Store
from islands_service.store.database import StoreUnavailableError
from support.processes import alive, eventually
from support.stores import ALICE, child, claimed, submitted, turn_clock

BROKEN = """
import sys, time
from islands_service.liveness import StopRequest
from islands_service.coordinator import heartbeat
from islands_service.store import Store
with Store(sys.argv[1]) as store:
    lease = store.leases.claim("broken", 60.0)
    with heartbeat.Heartbeat(store, lease, 0.3, StopRequest()):
        def fail(*_):
            raise MemoryError
        store.leases.renew = store.leases.read_requests = fail
        time.sleep(10.0)
        print("went on", flush=True)
"""


#: Seconds of a lease, in which it is renewed ten times.
SECONDS = 0.3

#: Starts a child process, opens a pipe, and restarts while the main thread computes. The second start prints
#: which of its descriptors are open.
SCRIPT = """
import os, subprocess, sys
from threading import Timer
from islands_service.coordinator.heartbeat import restart_process
lifeline, marker = int(sys.argv[1]), sys.argv[2]
if os.path.exists(marker):
    child, other, pid = open(marker).read().split()
    opened = {int(each) for each in os.listdir("/proc/self/fd")}
    print(child, int(other) in opened, int(pid) == os.getpid(), flush=True)
    os.write(lifeline, b"again")
    sys.exit()
child = subprocess.Popen(["sleep", "600"])
other, _ = os.pipe()
other = os.dup2(other, 100, inheritable=True)
with open(marker, "w") as file:
    print(child.pid, other, os.getpid(), file=file)
Timer(0.1, restart_process, (lifeline, None)).start()
while True:
    pass
"""


@pytest.fixture
def lease(store: Store) -> Lease:
    submitted(store)
    return claimed(store, SECONDS)


def take_over(store: Store) -> Lease:
    """Claim the job for another coordinator as soon as its lease has expired."""
    found = eventually(lambda: store.leases.claim("another", 60.0), seconds=20.0)
    assert isinstance(found, Lease)
    return found


def raised_by_check(heartbeat: Heartbeat) -> type[Exception] | None:
    """Return the type of the error that a check raises."""
    try:
        heartbeat.check()
    except Exception as error:
        return type(error)
    return None


class Clock:
    """Clock of the heartbeats that the test advances. The load of the machine does not matter then."""

    def __init__(self) -> None:
        self.now, self.reads = 0.0, 0

    def __call__(self) -> float:
        self.reads += 1
        return self.now

    def await_beat(self) -> None:
        """Wait for a whole beat, in which the clock is read twice, after the one that may be in progress."""
        before = self.reads
        eventually(lambda: self.reads >= before + 5, seconds=20.0)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(heartbeats, "monotonic", made)
    return made


class Watched:
    """Leases that record the result of every renewal."""

    def __init__(self, store: Store) -> None:
        self._leases, self.leases = store.leases, self
        self.renewals: list[Renewal] = []

    def renew(self, lease: Lease, seconds: float, ran: float) -> Renewal:
        self.renewals.append(self._leases.renew(lease, seconds, ran))
        return self.renewals[-1]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._leases, name)


def test_heartbeat_keeps_the_lease_beyond_its_duration(
    store: Store, clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The job cannot be claimed while its lease is renewed, but can be afterwards."""
    monkeypatch.setattr(heartbeats, "CANCEL_POLL", 0.02)
    submitted(store)
    watched = Watched(store)
    with Heartbeat(watched, claimed(store, 60.0), 60.0, StopRequest()) as heartbeat:  # type: ignore[arg-type]
        for _ in range(12):  # a renewal is due every tenth of the lease
            before = len(watched.renewals)
            turn_clock(store, 6.0)
            clock.now += 6.0
            eventually(lambda before=before: len(watched.renewals) > before, seconds=20.0)
            assert store.leases.claim("another", SECONDS) is None
            heartbeat.check()
    assert store.leases.claim("another", SECONDS) is None
    turn_clock(store, 61.0)
    assert store.leases.claim("another", SECONDS) is not None


def test_lost_lease_is_reported_and_nothing_is_written(store: Store, lease: Lease) -> None:
    take_over(store)
    before = store.jobs.get(ALICE, lease.job.id)
    with Heartbeat(store, lease, SECONDS, StopRequest()) as heartbeat:
        eventually(lambda: raised_by_check(heartbeat) is LeaseLostError, seconds=20.0)
        heartbeat._thread.join(SECONDS)  # ten more renewals, if it continued
    assert store.jobs.get(ALICE, lease.job.id) == before


def test_lost_lease_precedes_cancellation_and_that_precedes_a_stop(store: Store, lease: Lease) -> None:
    """A stopping coordinator releases the job: a cancelled or lost job must not return to the queue."""
    stopping = StopRequest()
    stopping.request()
    with Heartbeat(store, lease, SECONDS, stopping) as heartbeat:
        store.jobs.cancel(ALICE, lease.job.id)
        eventually(lambda: raised_by_check(heartbeat) is JobCancelled, seconds=20.0)
        store.leases.finish(lease, JobOutcome(JobState.CANCELLED))
        eventually(lambda: raised_by_check(heartbeat) is LeaseLostError, seconds=20.0)


def test_cancelled_job_without_checks_is_cancelled_by_the_heartbeat(
    store: Store, lease: Lease, clock: Clock
) -> None:
    with Heartbeat(store, lease, SECONDS, StopRequest()) as heartbeat:
        store.jobs.cancel(ALICE, lease.job.id)
        eventually(lambda: raised_by_check(heartbeat) is JobCancelled, seconds=20.0)
        clock.now += heartbeats.CANCEL_GRACE
        clock.await_beat()
        assert store.jobs.get(ALICE, lease.job.id).state == JobState.RUNNING
        clock.now += 0.01
        eventually(lambda: store.jobs.get(ALICE, lease.job.id).state == JobState.CANCELLED, seconds=20.0)
        eventually(lambda: raised_by_check(heartbeat) is LeaseLostError, seconds=20.0)
    with pytest.raises(LeaseLostError):
        store.leases.finish(lease, JobOutcome(JobState.SUCCEEDED, {}))


def test_job_that_does_not_end_is_abandoned_once_and_stored_as_cancelled(
    store: Store, lease: Lease, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(heartbeats, "CANCEL_GRACE", 0.1)
    states = []

    def abandon() -> None:
        states.append(store.jobs.get(ALICE, lease.job.id).state)

    with Heartbeat(store, lease, SECONDS, StopRequest(), abandon):
        store.jobs.cancel(ALICE, lease.job.id)
        eventually(lambda: states, seconds=20.0)
        time.sleep(0.3)
    assert states == [JobState.CANCELLED]


def test_job_at_its_limit_of_run_time_has_a_grace_and_then_fails(store: Store, clock: Clock) -> None:
    """The time of all attempts counts, up to the last renewal of each."""
    submitted(store)
    for ran in (6.0, 6.0):
        with Heartbeat(
            store, lease := claimed(store, 60.0), 60.0, StopRequest(), max_run_seconds=15
        ) as heartbeat:
            clock.await_beat()
            clock.now += ran
            clock.await_beat()
            heartbeat.check()
        store.leases.release(lease)
    assert store.jobs.get(ALICE, lease.job.id).run_seconds == 12.0
    with Heartbeat(store, claimed(store, 60.0), 60.0, StopRequest(), max_run_seconds=15) as heartbeat:
        clock.now += 6.0
        eventually(lambda: raised_by_check(heartbeat) is RunTimeLimitError, seconds=20.0)
        clock.now += heartbeats.RUN_LIMIT_GRACE
        clock.await_beat()
        assert store.jobs.get(ALICE, lease.job.id).state == JobState.RUNNING
        clock.now += 0.01
        eventually(lambda: raised_by_check(heartbeat) is LeaseLostError, seconds=20.0)
    failed = store.jobs.get(ALICE, lease.job.id)
    assert failed.state == JobState.FAILED
    assert failed.problem is not None
    assert failed.problem["type"] == "run-time-limit"
    assert "the job ran for 15 s" in failed.problem["detail"]
    assert store.jobs.resume(ALICE, failed.id).run_seconds == 0.0


def test_time_in_which_all_islands_wait_for_a_cpu_is_no_run_time(store: Store, clock: Clock) -> None:
    submitted(store)
    with Heartbeat(
        store, lease := claimed(store, 60.0), 60.0, StopRequest(), max_run_seconds=10
    ) as heartbeat:
        clock.await_beat()
        heartbeat.observe_islands(0, 2)
        clock.now += 100.0
        clock.await_beat()
        heartbeat.observe_islands(1, 1)
        clock.now += 7.0
        clock.await_beat()
        heartbeat.check()
    assert store.jobs.get(ALICE, lease.job.id).run_seconds == 7.0


def test_job_of_a_lost_lease_is_abandoned(
    store: Store, lease: Lease, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another coordinator runs it, so that this one computes for nothing."""
    monkeypatch.setattr(heartbeats, "CANCEL_GRACE", 0.1)
    take_over(store)
    abandoned = Event()
    with Heartbeat(store, lease, SECONDS, StopRequest(), abandoned.set):
        assert abandoned.wait(20.0)
    assert store.jobs.get(ALICE, lease.job.id).state == JobState.RUNNING


class Away:
    """Leases of a database that is unavailable for some renewals."""

    def __init__(self, store: Store, beats: int) -> None:
        self._store, self.left = store, beats
        self.leases = self

    def renew(self, lease: Lease, seconds: float, ran: float) -> Renewal:
        if self.left:
            self.left -= 1
            raise StoreUnavailableError("the database does not answer")
        return self._store.leases.renew(lease, seconds, ran)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._store.leases, name)


def test_long_database_outage_loses_the_lease_to_another(store: Store, lease: Lease) -> None:
    away = Away(store, 10**9)
    with Heartbeat(away, lease, SECONDS, StopRequest()) as heartbeat:  # type: ignore[arg-type]
        heartbeat.check()
        take_over(store)
        heartbeat.check()  # the lost lease is not known yet
        away.left = 0
        eventually(lambda: raised_by_check(heartbeat) is LeaseLostError, seconds=20.0)


HANGING = """
import sys, time
from islands_service.liveness import StopRequest
from islands_service.coordinator import heartbeat
from islands_service.store import Store
now = cpu = 0.0
reads = 0
def clock():
    global reads
    reads += 1
    return now
heartbeat.monotonic, heartbeat.process_time = clock, lambda: cpu
def spend(seconds, share):
    "Advance the clocks until the heartbeat has read them in two beats."
    global now, cpu
    cpu += share * seconds
    now += seconds
    before = reads
    while reads < before + 5:
        time.sleep(0.01)
with Store(sys.argv[1]) as store:
    lease = store.leases.claim("hanging", 1.0)
    with heartbeat.Heartbeat(store, lease, 0.3, StopRequest()) as beating:
        spend(4000.0, 0.06)  # reading a record
        print("went on", flush=True)
        beating.check()
        with beating.search():
            for _ in range(12):
                spend(500.0, 0.0)
                beating.check()
        spend(4000.0, 0.06)  # refining
        print("went on", flush=True)
        beating.check()
        if sys.argv[2:] == ["idle"]:
            spend(4000.0, 0.04)
            print("went on", flush=True)
        if sys.argv[2:] == ["lost"]:
            store.leases.finish(lease, heartbeat.JobOutcome(heartbeat.JobState.CANCELLED))
            spend(1.0, 1.0)
        with beating.search():
            spend(700.0, 1.0)
            print("went on", flush=True)
"""


@pytest.mark.parametrize(
    ("how", "message"),
    [
        pytest.param("", "search hangs", marks=pytest.mark.ci),
        pytest.param("lost", "search hangs", marks=pytest.mark.ci),
        pytest.param("idle", "job hangs", marks=pytest.mark.ci),
    ],
)
def test_job_without_checks_ends_the_process_unless_it_computes(store: Store, how: str, message: str) -> None:
    job = submitted(store)
    with child(HANGING, store.database.url, *filter(None, [how])) as hanging:
        said, _ = hanging.communicate(timeout=30)
    assert message in said
    assert (said.count("went on"), hanging.returncode) == (2, 1)
    if how != "lost":
        assert take_over(store).job.id == job.id


def test_request_to_stop_the_search_is_kept_and_ends_no_check(store: Store, lease: Lease) -> None:
    with Heartbeat(store, lease, SECONDS, StopRequest()) as heartbeat:
        assert not heartbeat.is_search_stopped()
        store.jobs.stop(ALICE, lease.job.id)
        eventually(heartbeat.is_search_stopped)
        heartbeat.check()
    # A coordinator that takes the job over knows the request from the start.
    with Heartbeat(store, take_over(store), SECONDS, StopRequest()) as heartbeat:
        assert heartbeat.is_search_stopped()


@pytest.mark.ci
def test_heartbeat_that_fails_unexpectedly_ends_the_process(store: Store) -> None:
    """Otherwise the job would run on without a lease and without a guard."""
    submitted(store)
    with child(BROKEN, store.database.url) as broken:
        said, _ = broken.communicate(timeout=30)
    assert "MemoryError" in said
    assert "went on" not in said
    assert broken.returncode == 1


def test_restart_ends_the_computation_and_keeps_the_process_and_its_lifeline(tmp_path):
    reading, writing = os.pipe()
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    command = [sys.executable, str(script), str(writing), str(tmp_path / "marker")]
    ended = subprocess.run(
        command, pass_fds=(writing,), capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 0, ended.stderr
    child, other_is_open, is_same_process = ended.stdout.split()
    assert (other_is_open, is_same_process) == ("False", "True")
    assert not alive([int(child)])
    assert os.read(reading, 6) == b"sagain"
    for each in (reading, writing):
        os.close(each)
