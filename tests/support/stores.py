"""Helpers for tests of the store: jobs in any state, table contents, concurrent calls, other processes."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from uuid import uuid4

from sqlalchemy import Connection, event, select, update

from islands_service.domain.job import Job, JobOutcome, JobState, Lease, ProgressReport, Submission
from islands_service.store import Store
from islands_service.store.tables import deliveries, metadata, webhooks
from support.processes import eventually

ALICE, BOB = "alice", "bob"

#: Duration of a lease in seconds, longer than any test.
LONG = 3600.0

#: Duration in seconds of a lease that has already expired when it is claimed.
EXPIRED = -1.0

#: Number of concurrent threads.
MANY = 16

BLOB = "b" * 64

FOUND = JobOutcome(
    JobState.SUCCEEDED,
    {"search": {"seed": 7}, "loop": True},
    (({"fitness": 0.5}, "first"), ({"fitness": 0.7}, "second")),
    {"best": 0.5},
)
FAILED = JobOutcome(JobState.FAILED, problem={"type": "broken", "detail": "it broke"})
CANCELLED = JobOutcome(JobState.CANCELLED)


def asked(owner: str = ALICE, /, **changes: Any) -> Submission:
    return Submission(owner, **{"spec": {"seed": 7}} | changes)


def submitted(store: Store, owner: str = ALICE, /, **changes: Any) -> Job:
    return store.jobs.submit(asked(owner, **changes))[0]


def claimed(store: Store, seconds: float = LONG, owner: str | None = None) -> Lease:
    """Claim a job, by default under a new unique name."""
    lease = store.leases.claim(owner or uuid4().hex, seconds)
    assert lease is not None
    return lease


def taken(store: Store, job: str) -> Lease:
    """Claim a job and all jobs ahead of it in the queue; return the lease of the job."""
    while (lease := store.leases.claim(uuid4().hex, LONG)) is not None:
        if lease.job.id == job:
            return lease
    raise AssertionError(f"job {job} is not queued")


def point(generation: int) -> tuple[int, int, dict[int, float], tuple[float | None, ...]]:
    return generation, 10 * generation, {3: 1 / (1 + generation)}, (0.5, None)


def brought_on(generation: int) -> ProgressReport:
    """Make a progress report in which every part has the same generation."""
    return ProgressReport(
        {"generation": generation}, (point(generation),), f"{generation:064x}", generation - 1
    )


#: Steps that bring a queued job to a state.
_REACH: dict[JobState, tuple[Callable[[Store], object], ...]] = {
    JobState.QUEUED: (),
    JobState.RUNNING: (claimed,),
    JobState.SUCCEEDED: (lambda store: store.leases.finish(claimed(store), FOUND),),
    JobState.FAILED: (lambda store: store.leases.finish(claimed(store), FAILED),),
    JobState.CANCELLED: (lambda store: store.leases.finish(claimed(store), CANCELLED),),
}


def job_in(store: Store, state: JobState, owner: str = ALICE, /, **changes: Any) -> Job:
    """Submit a job and bring it to a state; the store has no other queued job."""
    job = submitted(store, owner, **changes)
    for step in _REACH[state]:
        step(store)
    job = store.jobs.get(owner, job.id)
    assert job.state == state
    return job


def expire_webhooks(store: Store) -> None:
    """Make every unfinished delivery due, and let the leases of webhooks expire, as time does."""

    def operation(connection: Connection) -> None:
        unfinished = update(deliveries).where(deliveries.c.next_at.is_not(None))
        connection.execute(unfinished.values(next_at=0.0))
        connection.execute(update(webhooks).values(busy_until=0.0))

    store.database.write(operation)


def contents(store: Store) -> dict[str, list[tuple[Any, ...]]]:
    """Return every row of every table."""
    with store.database.read() as connection:
        return {
            table.name: sorted((tuple(row) for row in connection.execute(select(table))), key=repr)
            for table in metadata.sorted_tables
        }


def turn_clock(store: Store, seconds: float) -> None:
    """Let the clock of the database jump: all stored times move the other way."""
    columns = {
        "jobs": ("created", "updated", "started", "finished", "lease_until", "not_before"),
        "events": ("at",),
        "retired_keys": ("finished",),
        "webhooks": ("created", "busy_until"),
        "deliveries": ("created", "next_at", "attempted", "delivered"),
    }

    def operation(connection: Connection) -> None:
        for name, times in columns.items():
            table = metadata.tables[name]
            connection.execute(update(table).values({time: table.c[time] - seconds for time in times}))

    store.database.write(operation)


def kinds(store: Store, job: str) -> list[str]:
    """Return the kinds of the events of a job; check that none is missing."""
    events = store.jobs.events(job)
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert store.jobs.versions([job]) == {job: len(events)}
    return [event.kind for event in events]


def at_once(actions: list[Callable[[], Any]]) -> list[Any]:
    """Call functions concurrently, each in a thread; return their results or exceptions."""
    ready, results = threading.Barrier(len(actions)), [None] * len(actions)

    def act(index: int) -> None:
        ready.wait()
        try:
            results[index] = actions[index]()
        except Exception as error:
            results[index] = error

    threads = [threading.Thread(target=act, args=(index,)) for index in range(len(actions))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return results


#: Script that claims the first job, updates it and stops inside the transaction until SIGCONT. It stops the
#: writer thread: another thread might handle a signal to the process, and the writer might commit before.
_STOPPED_WRITER = """
import signal, sys, threading
from islands_service.store import Store, dialect
from islands_service.store.job_rows import update_job
dialect.SETTINGS = (f"idle_in_transaction_session_timeout = '{sys.argv[2]}s'",)
store = Store(sys.argv[1])
lease = store.leases.claim("first", -1.0)
def update_and_stop(connection):
    update_job(connection, lease.job.id, progress='{"half": true}')
    print("stopped", flush=True)
    signal.pthread_kill(threading.get_ident(), signal.SIGSTOP)
try:
    store.database.write(update_and_stop)
except Exception as error:
    print(repr(error), flush=True)
"""


@contextmanager
def stopped_writer(database: str, seconds: int) -> Iterator[subprocess.Popen[str]]:
    """Run a process that is stopped inside a write.

    PostgreSQL ends its transaction after the given seconds.
    """
    with child(_STOPPED_WRITER, database, str(seconds)) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "stopped\n"
        yield process


@contextmanager
def open_stores(database: str, count: int = 4) -> Iterator[list[Store]]:
    """Open a database several times, like several processes: each store has a separate writer."""
    with ExitStack() as stack:
        yield [stack.enter_context(Store(database)) for _ in range(count)]


@contextmanager
def commits(store: Store) -> Iterator[list[float]]:
    """Yield the list of times at which a store commits writes."""
    times: list[float] = []

    def committed(connection: Any) -> None:
        if connection.get_execution_options().get("writes"):
            times.append(time.monotonic())

    event.listen(store.database.engine, "commit", committed)
    try:
        yield times
    finally:
        event.remove(store.database.engine, "commit", committed)


def wait_for_queued_writes(store: Store, count: int) -> None:
    """Wait until at least ``count`` writes are queued for the writer of a store."""
    eventually(lambda: store.database._waiting.qsize() >= count)


@contextmanager
def one_group(store: Store, count: int) -> Iterator[None]:
    """Keep the writer of a store busy until ``count`` writes are queued, so that they form one group."""
    busy, free = threading.Event(), threading.Event()
    blocker = threading.Thread(target=store.database.write, args=(lambda _: (busy.set(), free.wait()),))
    blocker.start()
    busy.wait()
    try:
        yield
        wait_for_queued_writes(store, count)
    finally:
        free.set()
        blocker.join()


@contextmanager
def child(script: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a script in a separate process."""
    command = [sys.executable, "-W", "error", "-c", script, *arguments]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()
