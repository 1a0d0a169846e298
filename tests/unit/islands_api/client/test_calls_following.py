"""Following a job by long polling and by events, over reliable and broken connections."""

import time
from collections.abc import Callable
from typing import Any

import pytest

from islands_api.client import (
    Event,
    JobFailedError,
)
from islands_service.domain.job import JobOutcome, JobState
from support.service import Service
from support.stores import CANCELLED, FAILED, FOUND, brought_on

SPEC = {"inputs": ["u_V"], "output": "y_um"}

pytestmark = [pytest.mark.ci, pytest.mark.usefixtures("quick")]

#: Generations that a job reports between its claim and its end.
GENERATIONS = range(1, 7)


@pytest.fixture
def run_job(service: Service, claimed: Any) -> Callable[..., None]:
    """Return a function that runs a job with a pause between the steps."""

    def run(job: Any, pause: float = 0.0, outcome: JobOutcome = FOUND) -> None:
        lease = claimed(job)
        for generation in GENERATIONS:
            time.sleep(pause)
            service.store.leases.report(lease, brought_on(generation))
        time.sleep(pause)
        service.store.leases.finish(lease, outcome)

    return run


@pytest.fixture
def job(client: Any, me: Any) -> Any:
    return client.submit(me.dataset, **SPEC)


def expected_events(outcome: str = "succeeded") -> list[tuple[int, str]]:
    kinds = ["queued", "running", *("progress" for _ in GENERATIONS), outcome]
    return list(enumerate(kinds, start=1))


def numbers_and_kinds(events: Any) -> list[tuple[int, str]]:
    return [(event.number, event.kind) for event in events]


# By long polling.


def test_progress_yields_increasing_versions_until_the_job_ends(
    client: Any, job: Any, run_job: Any, later: Any
) -> None:
    progress = client.progress(job)
    states = [next(progress)]
    later(0.0, run_job, job, 0.1)
    states += progress
    assert [states[0].state, states[-1].state] == [JobState.QUEUED, JobState.SUCCEEDED]
    versions = [each.version for each in states]
    assert versions == sorted(set(versions))
    generations = [each.progress["generation"] for each in states if "generation" in (each.progress or {})]
    assert generations == sorted(generations)
    assert len(set(generations)) >= 2  # states of the running job were seen


def test_wait_returns_the_succeeded_job(client: Any, job: Any, run_job: Any, later: Any) -> None:
    later(0.1, run_job, job)
    done = client.wait(job.id)
    assert (done.state, done.summary) == (JobState.SUCCEEDED, FOUND.summary)
    assert client.wait(done, 0.0) == done  # an ended job is returned immediately


@pytest.mark.parametrize(
    ("outcome", "message"), [(FAILED, "failed: it broke"), (CANCELLED, "cancelled: it was cancelled")]
)
def test_wait_raises_the_reason_of_an_unsuccessful_job(
    client: Any, job: Any, run_job: Any, later: Any, outcome: JobOutcome, message: str
) -> None:
    later(0.1, run_job, job, 0.0, outcome)
    with pytest.raises(JobFailedError) as caught:
        client.wait(job)
    assert str(caught.value) == f"job {job.id} {message}"


# By events.


def test_events_arrive_in_order_until_the_job_has_ended(
    client: Any, job: Any, run_job: Any, later: Any
) -> None:
    later(0.05, run_job, job, 0.02)
    events = list(client.events(job))
    assert numbers_and_kinds(events) == expected_events()
    assert all(isinstance(event, Event) for event in events)
    assert events[1].data["attempt"] == 1
    assert [event.data["generation"] for event in events[2:-1]] == list(GENERATIONS)


@pytest.mark.parametrize("passed", [999, 1300])
def test_events_are_complete_over_broken_connections(
    connect: Any, me: Any, wire: Any, client: Any, job: Any, run_job: Any, passed: int
) -> None:
    run_job(job)
    # The header of an answer has some 800 bytes: some cuts are in it, others in the middle of an event.
    wire.cuts = [passed, 40, 900]
    assert numbers_and_kinds(connect(wire.url, me.secret).events(job)) == expected_events()
    assert wire.connections > 2


def test_silent_connection_is_reopened_after_the_timeout(
    connect: Any, service: Service, me: Any, job: Any, run_job: Any, later: Any
) -> None:
    later(1.2, run_job, job)
    assert (
        numbers_and_kinds(connect(service.url, me.secret, timeout=0.5, retry=1.0).events(job))
        == expected_events()
    )
