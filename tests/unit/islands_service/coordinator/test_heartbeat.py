"""The heartbeat: keeps a lease, hears of a wish to cancel, and says when a job is not ours any more."""

import time
from typing import Any

import pytest

from islands_service.coordinator import heartbeat as heartbeats
from islands_service.coordinator.heartbeat import CoordinatorStopping, Heartbeat, JobCancelled
from islands_service.domain.job import JobOutcome, JobState, Lease, LeaseLostError
from islands_service.liveness import StopRequest
from islands_service.store import Store
from islands_service.store.database import StoreUnavailableError
from support.processes import eventually
from support.stores import ALICE, child, claimed, job_in, submitted

#: Seconds of a lease: ten beats.
SECONDS = 0.3


@pytest.fixture
def lease(store: Store) -> Lease:
    submitted(store)
    return claimed(store, SECONDS)


def taken_over(store: Store) -> Lease:
    """Have another coordinator claim the job as soon as its lease has run out."""
    found = eventually(lambda: store.leases.claim("another", 60.0), seconds=20.0)
    assert isinstance(found, Lease)
    return found


def said(heartbeat: Heartbeat) -> type[Exception] | None:
    """Return what a check raises."""
    try:
        heartbeat.check()
    except Exception as error:
        return type(error)
    return None


class Watched:
    """Leases that keep what every beat was told: whether somebody wishes to cancel the job."""

    def __init__(self, store: Store) -> None:
        self._leases, self.leases = store.leases, self
        self.told: list[bool] = []

    def renew(self, lease: Lease, seconds: float) -> bool:
        self.told.append(self._leases.renew(lease, seconds))
        return self.told[-1]

    def __getattr__(self, name: str) -> Any:
        return getattr(self._leases, name)


def test_a_job_goes_on_as_long_as_its_heart_beats(store: Store) -> None:
    """Until it has beaten for longer than its lease, nobody else can claim the job; then somebody can."""
    submitted(store)
    lease = claimed(store, 1.0)
    watched = Watched(store)
    with Heartbeat(watched, lease, 1.0, StopRequest()) as heartbeat:  # type: ignore[arg-type]
        while len(watched.told) < 12:  # a beat is a tenth of the lease
            assert store.leases.claim("another", SECONDS) is None
            heartbeat.check()
            time.sleep(0.02)
    eventually(lambda: store.leases.claim("another", SECONDS), seconds=20.0)


def test_the_beat_ends_with_the_block_whatever_happens_in_it(store: Store, lease: Lease) -> None:
    with pytest.raises(ZeroDivisionError), Heartbeat(store, lease, SECONDS, StopRequest()) as heartbeat:
        1 / 0  # noqa: B018
    assert not heartbeat._thread.is_alive()


def test_a_wish_to_cancel_is_heard_with_the_next_beat(store: Store, lease: Lease) -> None:
    watched = Watched(store)
    with Heartbeat(watched, lease, 4.0, StopRequest()) as heartbeat:  # type: ignore[arg-type]
        heartbeat.check()
        store.jobs.cancel(ALICE, lease.job.id)
        before = len(watched.told)
        eventually(lambda: said(heartbeat) is JobCancelled, seconds=20.0)
    assert watched.told.index(True) <= before + 1  # one may have been under way


def test_a_wish_to_cancel_from_before_the_lease_is_heard_at_once(store: Store, lease: Lease) -> None:
    store.jobs.cancel(ALICE, lease.job.id)
    taken = taken_over(store)
    with Heartbeat(store, taken, 60.0, StopRequest()) as heartbeat, pytest.raises(JobCancelled):
        heartbeat.check()


def test_who_has_lost_the_lease_is_told_and_writes_nothing(store: Store, lease: Lease) -> None:
    taken_over(store)
    before = store.jobs.get(ALICE, lease.job.id)
    with Heartbeat(store, lease, SECONDS, StopRequest()) as heartbeat:
        eventually(lambda: said(heartbeat) is LeaseLostError, seconds=20.0)
        heartbeat._thread.join(SECONDS)  # ten beats more, if it went on
    assert store.jobs.get(ALICE, lease.job.id) == before


def test_a_coordinator_that_is_to_stop_is_told_so_at_once(store: Store, lease: Lease) -> None:
    stopping = StopRequest()
    with Heartbeat(store, lease, SECONDS, stopping) as heartbeat:
        heartbeat.check()
        stopping.request()
        with pytest.raises(CoordinatorStopping):
            heartbeat.check()


def test_a_lost_lease_counts_more_than_a_cancelled_job_and_that_more_than_the_end(
    store: Store, lease: Lease
) -> None:
    """Who stops releases the job: one that is cancelled, or not ours, must not be given back to the queue."""
    stopping = StopRequest()
    stopping.request()
    with Heartbeat(store, lease, SECONDS, stopping) as heartbeat:
        store.jobs.cancel(ALICE, lease.job.id)
        eventually(lambda: said(heartbeat) is JobCancelled, seconds=20.0)
        store.leases.finish(lease, JobOutcome(JobState.CANCELLED))
        eventually(lambda: said(heartbeat) is LeaseLostError, seconds=20.0)


def test_a_cancelled_job_that_asks_nobody_is_cancelled_over_its_head(
    store: Store, lease: Lease, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(heartbeats, "GRACE", 0.3)
    with Heartbeat(store, lease, SECONDS, StopRequest()) as heartbeat:
        store.jobs.cancel(ALICE, lease.job.id)
        asked = time.monotonic()
        eventually(lambda: store.jobs.get(ALICE, lease.job.id).state == JobState.CANCELLED, seconds=20.0)
        assert time.monotonic() - asked > 0.25
        eventually(lambda: said(heartbeat) is LeaseLostError, seconds=20.0)
    with pytest.raises(LeaseLostError):
        store.leases.finish(lease, JobOutcome(JobState.SUCCEEDED, {}))


def test_a_job_that_lets_go_in_time_writes_its_own_end(
    store: Store, lease: Lease, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(heartbeats, "GRACE", 5.0)
    with Heartbeat(store, lease, SECONDS, StopRequest()) as heartbeat:
        store.jobs.cancel(ALICE, lease.job.id)
        eventually(lambda: said(heartbeat) is JobCancelled, seconds=20.0)
        time.sleep(0.2)
        store.leases.finish(lease, JobOutcome(JobState.CANCELLED, summary={"mine": True}))
    assert store.jobs.get(ALICE, lease.job.id).summary == {"mine": True}


class Away:
    """Leases of a database that is away for some beats."""

    def __init__(self, store: Store, beats: int) -> None:
        self._store, self.left = store, beats
        self.leases = self

    def renew(self, lease: Lease, seconds: float) -> bool:
        if self.left:
            self.left -= 1
            raise StoreUnavailableError("the database does not answer")
        return self._store.leases.renew(lease, seconds)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._store.leases, name)


def test_a_database_that_is_away_for_some_beats_costs_nothing(store: Store, lease: Lease) -> None:
    away = Away(store, 5)
    with Heartbeat(away, lease, SECONDS, StopRequest()) as heartbeat:  # type: ignore[arg-type]
        eventually(lambda: not away.left, seconds=20.0)
        store.jobs.cancel(ALICE, lease.job.id)
        eventually(lambda: said(heartbeat) is JobCancelled, seconds=20.0)


def test_a_database_that_was_away_for_too_long_has_given_the_job_to_another(
    store: Store, lease: Lease
) -> None:
    away = Away(store, 10**9)
    with Heartbeat(away, lease, SECONDS, StopRequest()) as heartbeat:  # type: ignore[arg-type]
        heartbeat.check()
        taken_over(store)
        heartbeat.check()  # nobody could tell it
        away.left = 0
        eventually(lambda: said(heartbeat) is LeaseLostError, seconds=20.0)


def test_a_finished_job_has_no_heartbeat(store: Store) -> None:
    job = job_in(store, JobState.SUCCEEDED)
    with Heartbeat(store, Lease(job, 1), SECONDS, StopRequest()) as heartbeat:
        eventually(lambda: said(heartbeat) is LeaseLostError, seconds=20.0)


HANGING = """
import sys, time
from islands_service.liveness import StopRequest
from islands_service.coordinator import heartbeat
from islands_service.store import Store
heartbeat.HANGS = 0.3
def silent():
    time.sleep(0.6)
    print("went on", flush=True)
with Store(sys.argv[1]) as store:
    lease = store.leases.claim("hanging", 1.0)
    with heartbeat.Heartbeat(store, lease, 0.3, StopRequest()) as beating:
        silent()  # reading a record
        with beating.search():
            for _ in range(12):
                time.sleep(0.05)
                beating.check()
        silent()  # refining
        if len(sys.argv) > 2:
            store.leases.finish(lease, heartbeat.JobOutcome(heartbeat.JobState.CANCELLED))
            time.sleep(0.1)
        with beating.search():
            silent()
"""


@pytest.mark.parametrize("lost", [pytest.param(False, marks=pytest.mark.ci), True])
def test_a_search_that_never_asks_again_ends_the_process_and_nothing_else_does(
    store: Store, lost: bool
) -> None:
    job = submitted(store)
    with child(HANGING, store.database.url, *["lost"] * lost) as hanging:
        said, _ = hanging.communicate(timeout=30)
    assert "search hangs" in said
    assert (said.count("went on"), hanging.returncode) == (2, 1)
    if not lost:
        assert taken_over(store).job.id == job.id
