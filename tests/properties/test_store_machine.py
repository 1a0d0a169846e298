"""State machine of the store: it behaves like a dictionary of jobs, whatever the order of the operations.

Owners, coordinators, expired coordinators and restarts act through two open stores. Leases expire at once or
never, so that no test waits.
"""

import shutil
from dataclasses import dataclass, field, replace
from itertools import count

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    Bundle,
    RuleBasedStateMachine,
    invariant,
    multiple,
    precondition,
    rule,
    run_state_machine_as_test,
)

from islands_service.domain.job import (
    ACTIVE,
    RESUMABLE,
    TERMINAL,
    IdempotencyError,
    JobDeletedError,
    JobNotFoundError,
    JobState,
    JobStateError,
    LeaseLostError,
    QuotaError,
)
from islands_service.domain.owner import DEFAULT_WEIGHT
from islands_service.store import Store, leases
from islands_service.store.fair_queue import STRIDE
from support.databases import emptied
from support.stores import ALICE, BOB, CANCELLED, EXPIRED, FAILED, FOUND, LONG, asked, brought_on

#: Fewer than in life, so that jobs are given up within a few steps.
ATTEMPTS = 2


@dataclass
class Known:
    """What the dictionary says of a job."""

    owner: str
    priority: int
    key: str | None
    created: float
    state: JobState = JobState.QUEUED
    attempt: int = 0
    stalled: int = 0
    epoch: int = 0
    holder: str | None = None
    expired: bool = False
    cancel: bool = False
    declined: set[str] = field(default_factory=set)
    checkpoint: str | None = None
    generations: list[int] = field(default_factory=list)
    models: int = 0
    events: list[str] = field(default_factory=lambda: ["queued"])

    def becomes(self, state, kind=None):
        self.state = state
        self.events.append(kind or str(state))


class Machine(RuleBasedStateMachine):
    leases = Bundle("leases")
    owners = st.sampled_from([ALICE, BOB])
    lasting = st.sampled_from([LONG, EXPIRED])
    versions = st.sampled_from(["1.0", "2.0"])

    def __init__(self, url):
        super().__init__()
        self.url = url
        self.stores = [Store(url), Store(url)]
        self.jobs = {}
        self.retired = {}  # priorities of deleted jobs, by owner and idempotency key
        self.tags = {ALICE: -1, BOB: -1}  # start tag of the last claim of each owner
        self.turn = count()

    @property
    def store(self):
        """One after the other: what one has written the other one finds."""
        return self.stores[next(self.turn) % 2]

    def teardown(self):
        for store in self.stores:
            store.close()

    def any_job(self, data):
        return data.draw(st.sampled_from([*self.jobs, "0" * 32]))

    def of(self, owner, *states):
        return [each for each in self.jobs.values() if each.owner == owner and each.state in states]

    @rule(
        owner=owners,
        priority=st.integers(-1, 1),
        key=st.none() | st.sampled_from("ab"),
        quota=st.none() | st.integers(0, 4),
    )
    def submit(self, owner, priority, key, quota):
        submission = asked(owner, priority=priority, idempotency_key=key)
        before = [name for name, each in self.jobs.items() if key and (each.owner, each.key) == (owner, key)]
        accepted = self.jobs[before[0]].priority if before else self.retired.get((owner, key), priority)
        refused = (
            IdempotencyError
            if accepted != priority
            else JobDeletedError
            if (owner, key) in self.retired
            else QuotaError
            if not before and quota is not None and len(self.of(owner, *ACTIVE)) >= quota
            else None
        )
        if refused is not None:
            with pytest.raises(refused):
                self.store.jobs.submit(submission, quota)
            return
        job, new = self.store.jobs.submit(submission, quota)
        assert new == (not before)
        if new:
            self.jobs[job.id] = Known(owner, priority, key, job.created)
        else:
            assert job.id == before[0]

    @rule(target=leases, name=st.sampled_from("xyz"), seconds=lasting, version=versions)
    def claim(self, name, seconds, version):
        lease = self.store.leases.claim(name, seconds, version)
        for job, owner in self.in_turn(name, version):
            known = self.jobs[job]
            if known.stalled < ATTEMPTS:
                if owner is not None:
                    self.tags[owner] = max(self.next_tag(owner), *self.tags.values())
                known.attempt, known.stalled = known.attempt + 1, known.stalled + 1
                known.epoch, known.holder, known.expired = known.epoch + 1, name, seconds == EXPIRED
                known.becomes(JobState.RUNNING)
                assert (lease.job.id, lease.epoch) == (job, known.epoch)
                return lease
            known.becomes(JobState.CANCELLED if known.cancel else JobState.FAILED)
        assert lease is None
        return multiple()

    def in_turn(self, name, version):
        """Return the jobs that can be claimed in order; with their owners, if a claim is one of these."""
        lost = [
            (each.created, job)
            for job, each in self.jobs.items()
            if each.state == JobState.RUNNING and (each.expired or each.holder == name)
        ]
        queued = [
            (self.next_tag(each.owner), each.owner, -each.priority, each.created, job)
            for job, each in self.jobs.items()
            if each.state == JobState.QUEUED and version not in each.declined
        ]
        return [(job, None) for _, job in sorted(lost)] + [(each[-1], each[1]) for each in sorted(queued)]

    def next_tag(self, owner):
        return self.tags[owner] + STRIDE // DEFAULT_WEIGHT if self.tags[owner] >= 0 else 0

    def held(self, lease, write):
        """Do something under a lease; return what is known of its job if the lease counts."""
        known = self.jobs.get(lease.job.id)
        if known is not None and known.state == JobState.RUNNING and known.epoch == lease.epoch:
            return write(), known
        with pytest.raises(LeaseLostError):
            write()
        return None, None

    @rule(lease=leases, seconds=lasting)
    def beat(self, lease, seconds):
        answer, known = self.held(lease, lambda: self.store.leases.renew(lease, seconds))
        if known is not None:
            assert answer.cancel_requested == known.cancel
            known.expired = seconds == EXPIRED

    @rule(lease=leases, generation=st.integers(0, 9), kept=st.booleans())
    def report(self, lease, generation, kept):
        report = brought_on(generation)
        if not kept:
            report = replace(report, checkpoint=None)
        answer, known = self.held(lease, lambda: self.store.leases.report(lease, report))
        if known is not None:
            known.generations = [each for each in known.generations if each < generation] + [generation]
            known.becomes(JobState.RUNNING, "progress")
            if kept:
                known.checkpoint, known.stalled = report.checkpoint, 0
            assert answer.version == len(known.events)

    @rule(lease=leases, attempted=st.booleans())
    def release(self, lease, attempted):
        self.give_back(lease, attempted, lambda: self.store.leases.release(lease, attempted))

    @rule(lease=leases)
    def postpone(self, lease):
        self.give_back(lease, True, lambda: self.store.leases.postpone(lease, "a note", 0.0))

    @rule(lease=leases, version=versions)
    def decline(self, lease, version):
        known = self.give_back(lease, False, lambda: self.store.leases.decline(lease, "a note", version))
        if known is not None:
            known.declined.add(version)

    def give_back(self, lease, attempted, write):
        _, known = self.held(lease, write)
        if known is not None:
            known.attempt -= not attempted
            known.stalled = max(known.stalled - (not attempted), 0)
            known.holder = None
            known.becomes(JobState.CANCELLED if known.cancel else JobState.QUEUED)
        return known

    @rule(lease=leases, outcome=st.sampled_from([FOUND, FAILED, CANCELLED]))
    def finish(self, lease, outcome):
        _, known = self.held(lease, lambda: self.store.leases.finish(lease, outcome))
        if known is not None:
            known.becomes(outcome.state)
            known.holder = None
            if outcome is FOUND:
                known.checkpoint, known.models = None, 2

    def asked(self, owner, job, ask, states):
        """Ask as an owner; return what is known of the job if it is theirs and its state allows that."""
        known = self.jobs.get(job)
        wrong = (
            JobNotFoundError
            if known is None or known.owner != owner
            else JobStateError
            if known.state not in states
            else None
        )
        if wrong is None:
            ask(owner, job)
            return known
        with pytest.raises(wrong):
            ask(owner, job)
        return None

    @rule(owner=owners, data=st.data())
    def cancel(self, owner, data):
        known = self.asked(owner, self.any_job(data), self.store.jobs.cancel, ACTIVE)
        if known is not None and not known.cancel:
            known.cancel = True
            if known.state == JobState.QUEUED:
                known.becomes(JobState.CANCELLED)
            else:
                known.becomes(JobState.RUNNING, "cancelling")

    @rule(owner=owners, data=st.data())
    def resume(self, owner, data):
        known = self.asked(owner, self.any_job(data), self.store.jobs.resume, RESUMABLE)
        if known is not None:
            known.cancel, known.stalled = False, 0
            known.becomes(JobState.QUEUED)

    @rule(owner=owners, data=st.data())
    def delete(self, owner, data):
        job = self.any_job(data)
        known = self.asked(owner, job, self.store.jobs.delete, TERMINAL)
        if known is not None:
            del self.jobs[job]
            if known.key:
                self.retired[owner, known.key] = known.priority

    @precondition(lambda self: len(self.jobs) > 3)
    @rule()
    def forget(self):
        gone = [job for job, known in self.jobs.items() if known.state in TERMINAL]
        assert self.store.retention.delete_expired(-1.0) == len(gone)
        for job in gone:
            del self.jobs[job]
        self.retired.clear()

    @rule()
    def restart(self):
        self.stores.pop(0).close()
        self.stores.append(Store(self.url))

    @invariant()
    def the_store_holds_what_the_dictionary_holds(self):
        store = self.store
        for owner in (ALICE, BOB):
            mine = sorted(
                ((each.created, job) for job, each in self.jobs.items() if each.owner == owner), reverse=True
            )
            found = store.jobs.page(owner, limit=200).jobs
            assert [job.id for job in found] == [job for _, job in mine]
            for job in found:
                known = self.jobs[job.id]
                assert (job.state, job.priority, job.attempt) == (known.state, known.priority, known.attempt)
                assert (job.cancel_requested, job.checkpoint) == (known.cancel, known.checkpoint)
                assert job.version == len(known.events)
                assert (job.finished is not None) == (job.state in TERMINAL)

    @invariant()
    def everything_that_happened_is_an_event(self):
        store = self.store
        assert store.jobs.versions(list(self.jobs)) == {
            job: len(known.events) for job, known in self.jobs.items()
        }
        for job, known in self.jobs.items():
            events = store.jobs.events(job)
            assert [(each.number, each.kind) for each in events] == list(enumerate(known.events, start=1))
            assert [each[0] for each in store.results.history(job)] == known.generations
            assert len(store.results.models(job)) == known.models


def play(url, monkeypatch, examples, steps):
    monkeypatch.setattr(leases, "ATTEMPTS", ATTEMPTS)
    run_state_machine_as_test(
        lambda: Machine(url()),
        settings=settings(
            max_examples=examples,
            stateful_step_count=steps,
            deadline=None,
            suppress_health_check=list(HealthCheck),
        ),
    )


@pytest.fixture
def new_sqlite(prepared_sqlite, tmp_path):
    """What makes a new SQLite file with our tables, and returns its URL."""
    numbers = count()
    return lambda: f"sqlite:///{shutil.copyfile(prepared_sqlite, tmp_path / f'{next(numbers)}.db')}"


# A step of the store takes milliseconds: fewer examples than the profile has, and more of them at night.


@pytest.mark.ci
def test_on_sqlite_the_store_is_a_dictionary(new_sqlite, monkeypatch):
    play(new_sqlite, monkeypatch, examples=10, steps=30)


@pytest.mark.nightly
def test_on_sqlite_the_store_is_a_dictionary_for_long(new_sqlite, monkeypatch):
    play(new_sqlite, monkeypatch, examples=40, steps=60)


@pytest.mark.ci
def test_on_postgresql_the_store_is_a_dictionary(prepared_postgres, monkeypatch):
    play(lambda: emptied(prepared_postgres), monkeypatch, examples=5, steps=30)


@pytest.mark.nightly
def test_on_postgresql_the_store_is_a_dictionary_for_long(prepared_postgres, monkeypatch):
    play(lambda: emptied(prepared_postgres), monkeypatch, examples=20, steps=40)
