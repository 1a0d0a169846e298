"""Stores in tests: jobs in every state, all that a database holds, what happens at once, other processes."""

import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any
from uuid import uuid4

from sqlalchemy import event, select

from islands_service.domain.job import Job, JobOutcome, JobState, Lease, ProgressReport, Submission
from islands_service.store import Store
from islands_service.store.tables import metadata
from support.processes import eventually

ALICE, BOB = "alice", "bob"

#: Seconds of a lease that a test does not outlive, and of one that has expired when it begins.
LONG, EXPIRED = 3600.0, -1.0

#: Threads that come at the same time.
MANY = 16

BLOB = "b" * 64

FOUND = JobOutcome(
    JobState.SUCCEEDED,
    {"search": {"seed": 7}},
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
    """Claim a job, under a name that nobody has had before unless one is given."""
    lease = store.leases.claim(owner or uuid4().hex, seconds)
    assert lease is not None
    return lease


def taken(store: Store, job: str) -> Lease:
    """Claim a job, and before it all that wait in front of it."""
    while (lease := store.leases.claim(uuid4().hex, LONG)) is not None:
        if lease.job.id == job:
            return lease
    raise AssertionError(f"job {job} does not wait")


def point(generation: int) -> tuple[int, int, dict[int, float], tuple[float | None, ...]]:
    return generation, 10 * generation, {3: 1 / (1 + generation)}, (0.5, None)


def brought_on(generation: int) -> ProgressReport:
    """A report in which every part says the same generation."""
    return ProgressReport(
        {"generation": generation}, (point(generation),), f"{generation:064x}", generation - 1
    )


#: How a job gets to a state, from the queue.
_REACH: dict[JobState, tuple[Callable[[Store], object], ...]] = {
    JobState.QUEUED: (),
    JobState.RUNNING: (claimed,),
    JobState.SUCCEEDED: (lambda store: store.leases.finish(claimed(store), FOUND),),
    JobState.FAILED: (lambda store: store.leases.finish(claimed(store), FAILED),),
    JobState.CANCELLED: (lambda store: store.leases.finish(claimed(store), CANCELLED),),
}


def job_in(store: Store, state: JobState, owner: str = ALICE, /, **changes: Any) -> Job:
    """Submit a job to a store in which none waits, and bring it to a state."""
    job = submitted(store, owner, **changes)
    for step in _REACH[state]:
        step(store)
    job = store.jobs.get(owner, job.id)
    assert job.state == state
    return job


def contents(store: Store) -> dict[str, list[tuple[Any, ...]]]:
    """Return every row of every table."""
    with store.database.read() as connection:
        return {
            table.name: sorted((tuple(row) for row in connection.execute(select(table))), key=repr)
            for table in metadata.sorted_tables
        }


def kinds(store: Store, job: str) -> list[str]:
    """Return what happened to a job, after making sure that nothing is missing."""
    events = store.jobs.events(job)
    assert [event.number for event in events] == list(range(1, len(events) + 1))
    assert store.jobs.versions([job]) == {job: len(events)}
    return [event.kind for event in events]


def at_once(actions: list[Callable[[], Any]]) -> list[Any]:
    """Do things at the same time in a thread each; return what each returned, or raised."""
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


#: Takes the first job, changes it, and stops in the middle of the transaction, until SIGCONT. A signal to the
#: whole process is handled by any of its threads, and this one, the writer, might commit before.
_STANDING = """
import signal, sys, threading
from islands_service.store import Store, connections
from islands_service.store.job_events import update_job
connections.SETTINGS = (f"idle_in_transaction_session_timeout = '{sys.argv[2]}s'",)
store = Store(sys.argv[1])
lease = store.leases.claim("first", -1.0)
def stand(connection):
    update_job(connection, lease.job.id, progress='{"half": true}')
    print("standing", flush=True)
    signal.pthread_kill(threading.get_ident(), signal.SIGSTOP)
try:
    store.database.write(stand)
except Exception as error:
    print(repr(error), flush=True)
"""


@contextmanager
def standing(database: str, seconds: int) -> Iterator[subprocess.Popen[str]]:
    """Run a process that has stopped inside a write; PostgreSQL ends its transaction after some seconds."""
    with child(_STANDING, database, str(seconds)) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "standing\n"
        yield process


@contextmanager
def several(database: str, count: int = 4) -> Iterator[list[Store]]:
    """Open a database several times, as processes do: each store has a writer and connections of its own."""
    with ExitStack() as stack:
        yield [stack.enter_context(Store(database)) for _ in range(count)]


@contextmanager
def commits(store: Store) -> Iterator[list[float]]:
    """Yield the list of times at which a store commits what it wrote."""
    times: list[float] = []

    def committed(connection: Any) -> None:
        if connection.get_execution_options().get("writes"):
            times.append(time.monotonic())

    event.listen(store.database.engine, "commit", committed)
    try:
        yield times
    finally:
        event.remove(store.database.engine, "commit", committed)


def waiting(store: Store, count: int) -> None:
    """Wait until so many writes wait for a store's writer."""
    eventually(lambda: store.database._waiting.qsize() >= count)


@contextmanager
def one_group(store: Store, count: int) -> Iterator[None]:
    """Keep a store's writer busy until so many writes wait: they make one group."""
    busy, free = threading.Event(), threading.Event()
    keeper = threading.Thread(target=store.database.write, args=(lambda _: (busy.set(), free.wait()),))
    keeper.start()
    busy.wait()
    try:
        yield
        waiting(store, count)
    finally:
        free.set()
        keeper.join()


@contextmanager
def child(script: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Run a script in a process of its own."""
    command = [sys.executable, "-W", "error", "-c", script, *arguments]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()
