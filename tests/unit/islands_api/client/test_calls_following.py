"""Following a job by long polling and by events, over reliable and broken connections."""

import time
from collections.abc import Callable
from typing import Any

import pytest

from islands_api.client import (
    Event,
    JobFailedError,
    ServiceError,
    ServiceUnreachableError,
)
from islands_api.client.responses import EventParser
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


def test_progress_yields_a_change_immediately(
    client: Any, service: Service, job: Any, later: Any, me: Any
) -> None:
    began = time.monotonic()
    progress = client.progress(job)
    assert next(progress).state == "queued"
    later(0.2, service.store.jobs.cancel, me.owner, job.id)
    assert [each.state for each in progress] == ["cancelled"]
    assert 0.2 <= time.monotonic() - began < 25.0
    requests = [entry for entry in service.logs if entry.get("path") == f"/v1/jobs/{job.id}"]
    assert len(requests) == 2  # the present state and the change: no busy polling


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


def test_wait_times_out(client: Any, job: Any) -> None:
    began = time.monotonic()
    with pytest.raises(TimeoutError, match=f"job {job.id} is still queued after 0.3 s"):
        client.wait(job, 0.3)
    assert 0.3 <= time.monotonic() - began < 25.0


def test_wait_times_out_while_the_service_is_unreachable(connect: Any, me: Any, wire: Any) -> None:
    client = connect(wire.url, me.secret, retry=60.0)
    job = client.submit(me.dataset, **SPEC)
    wire.tear()
    began = time.monotonic()
    with pytest.raises(TimeoutError, match=r"is not known to have ended after 0.3 s: .* does not answer"):
        client.wait(job, 0.3)
    assert time.monotonic() - began < 25.0


def test_wait_fails_after_a_long_outage(connect: Any, me: Any, wire: Any) -> None:
    client = connect(wire.url, me.secret, retry=0.3)
    job = client.submit(me.dataset, **SPEC)
    wire.tear()
    with pytest.raises(ServiceUnreachableError, match="does not answer"):
        client.wait(job, 60.0)


def test_wait_survives_a_restart_of_the_service(
    connect: Any, me: Any, wire: Any, run_job: Any, later: Any
) -> None:
    client = connect(wire.url, me.secret)
    job = client.submit(me.dataset, **SPEC)
    later(0.1, wire.outage, 0.3)
    later(0.2, run_job, job)
    assert client.wait(job).state == JobState.SUCCEEDED


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


def test_events_start_after_a_number(client: Any, job: Any, run_job: Any) -> None:
    run_job(job)
    for after in (0, 4, 8, 9):
        assert numbers_and_kinds(client.events(job, after)) == expected_events()[after:]


@pytest.mark.parametrize("passed", [999, 1300])
def test_events_are_complete_over_broken_connections(
    connect: Any, me: Any, wire: Any, client: Any, job: Any, run_job: Any, passed: int
) -> None:
    run_job(job)
    # The header of an answer has some 800 bytes: some cuts are in it, others in the middle of an event.
    wire.cuts = [passed, 40, 900]
    assert numbers_and_kinds(connect(wire.url, me.secret).events(job)) == expected_events()
    assert wire.connections > 2


def test_events_include_the_end_of_a_job_after_a_closed_stream(
    connect: Any, service: Service, me: Any, job: Any, run_job: Any, later: Any
) -> None:
    def end_streams() -> None:
        # Like a stopping service; the job ends before the client reconnects.
        run_job(job)
        service.app.state.islands.hub.close()
        time.sleep(0.05)
        service.app.state.islands.hub.closed = False

    service.app.state.islands.hub.closed = False
    later(0.15, end_streams)
    assert numbers_and_kinds(connect(service.url, me.secret).events(job)) == expected_events()


def test_silent_connection_is_reopened_after_the_timeout(
    connect: Any, service: Service, me: Any, job: Any, run_job: Any, later: Any
) -> None:
    later(1.2, run_job, job)
    assert (
        numbers_and_kinds(connect(service.url, me.secret, timeout=0.5, retry=1.0).events(job))
        == expected_events()
    )


def test_events_fail_after_a_long_outage(connect: Any, me: Any, wire: Any, job: Any) -> None:
    client = connect(wire.url, me.secret, retry=0.3)
    events = client.events(job)
    assert next(iter(events)).kind == "queued"
    wire.tear()
    with pytest.raises(ServiceUnreachableError, match="does not answer"):
        list(events)


def test_unknown_job_has_no_events(client: Any) -> None:
    with pytest.raises(ServiceError) as caught:
        list(client.events("unknown"))
    assert caught.value.type == "/problems/no-such-job"


def test_connection_broken_within_a_character_loses_nothing(
    connect: Any, me: Any, wire: Any, job: Any, service: Service, claimed: Any
) -> None:
    detail = "ü" * 500
    problem = {"type": "broken", "detail": detail}
    service.store.leases.finish(claimed(job), JobOutcome(JobState.FAILED, problem=problem))
    wire.cuts = [1500, 1501]  # one of the cuts is within a character
    *_, last = connect(wire.url, me.secret).events(job)
    assert last.data["detail"] == detail
    assert wire.connections > 2


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_parsed_events_do_not_depend_on_the_chunk_size(size: int) -> None:
    text = (
        ": alive\n\n" + 'id: 1\nevent: running\ndata: {"note": "ü: x"}\n\n' * 2 + "id: 9\nevent: prog"
    ).encode()
    parser = EventParser()
    found = [event for at in range(0, len(text), size) for event in parser.feed(text[at : at + size])]
    assert found == [Event(1, "running", {"note": "ü: x"})] * 2
