"""A job is followed: by asking until it has ended, and by its events, over lines that are cut."""

import asyncio
import time
from collections.abc import Callable
from typing import Any

import pytest

from islands_api.client import (
    AsyncClient,
    Event,
    JobFailedError,
    ServiceError,
    ServiceUnreachableError,
    transport,
)
from islands_api.client.response_parsing import EventLines
from islands_service.domain.job import JobOutcome, JobState
from support.service import Service
from support.stores import CANCELLED, FAILED, FOUND, brought_on

SPEC = {"inputs": ["u_V"], "output": "y_um"}

pytestmark = pytest.mark.usefixtures("quick")

#: What a job goes through: a claim, reports of progress, an end.
GENERATIONS = range(1, 7)


@pytest.fixture
def carried_out(service: Service, claimed: Any) -> Callable[..., None]:
    """What carries a job out, with a pause between the steps."""

    def carry_out(job: Any, pause: float = 0.0, outcome: JobOutcome = FOUND) -> None:
        lease = claimed(job)
        for generation in GENERATIONS:
            time.sleep(pause)
            service.store.leases.report(lease, brought_on(generation))
        time.sleep(pause)
        service.store.leases.finish(lease, outcome)

    return carry_out


@pytest.fixture
def job(client: Any, me: Any) -> Any:
    return client.submit(me.dataset, **SPEC)


def happened(outcome: str = "succeeded") -> list[tuple[int, str]]:
    kinds = ["queued", "running", *("progress" for _ in GENERATIONS), outcome]
    return list(enumerate(kinds, start=1))


def seen(events: Any) -> list[tuple[int, str]]:
    return [(event.number, event.kind) for event in events]


# By asking.


def test_progress_shows_every_state_it_meets_and_ends_with_the_job(
    client: Any, job: Any, carried_out: Any, later: Any
) -> None:
    later(0.05, carried_out, job, 0.06)
    met = list(client.progress(job))
    assert [met[0].state, met[-1].state] == [JobState.QUEUED, JobState.SUCCEEDED]
    versions = [each.version for each in met]
    assert versions == sorted(set(versions))
    told = [each.progress["generation"] for each in met if each.progress]
    assert told == sorted(told)
    assert len(set(told)) >= 2  # it was asked while the job went on


def test_a_change_is_told_when_it_happens(
    client: Any, service: Service, job: Any, later: Any, me: Any
) -> None:
    began = time.monotonic()
    later(0.2, service.store.jobs.cancel, me.owner, job.id)
    assert [each.state for each in client.progress(job)] == ["queued", "cancelled"]
    assert 0.2 <= time.monotonic() - began < 25.0
    asked = [entry for entry in service.logs if entry.get("path") == f"/v1/jobs/{job.id}"]
    assert len(asked) == 2  # as it is, and when it has changed: nobody asks again and again


def test_waiting_returns_the_job_that_has_succeeded(
    client: Any, job: Any, carried_out: Any, later: Any
) -> None:
    later(0.1, carried_out, job)
    done = client.wait(job.id)
    assert (done.state, done.summary) == (JobState.SUCCEEDED, FOUND.summary)
    assert client.wait(done, 0.0) == done  # of one that has ended nobody waits


@pytest.mark.parametrize(
    ("outcome", "told"), [(FAILED, "failed: it broke"), (CANCELLED, "cancelled: it was cancelled")]
)
def test_waiting_for_a_job_that_does_not_succeed_says_why(
    client: Any, job: Any, carried_out: Any, later: Any, outcome: JobOutcome, told: str
) -> None:
    later(0.1, carried_out, job, 0.0, outcome)
    with pytest.raises(JobFailedError) as caught:
        client.wait(job)
    assert str(caught.value) == f"job {job.id} {told}"


def test_waiting_ends_in_time(client: Any, job: Any) -> None:
    began = time.monotonic()
    with pytest.raises(TimeoutError, match=f"job {job.id} is still queued after 0.3 s"):
        client.wait(job, 0.3)
    assert 0.3 <= time.monotonic() - began < 25.0


def test_waiting_ends_in_time_though_the_job_goes_on(
    client: Any, job: Any, service: Service, claimed: Any, later: Any
) -> None:
    lease = claimed(job)
    for generation in range(1, 6):
        later(0.1 * generation, service.store.leases.report, lease, brought_on(generation))
    began = time.monotonic()
    with pytest.raises(TimeoutError, match="is still running after"):
        client.wait(job, 0.3)
    assert 0.3 <= time.monotonic() - began < 25.0


def test_waiting_ends_in_time_though_the_service_is_away(connect: Any, me: Any, wire: Any) -> None:
    client = connect(wire.url, me.secret, retry=60.0)
    job = client.submit(me.dataset, **SPEC)
    wire.tear()
    began = time.monotonic()
    with pytest.raises(TimeoutError, match=r"is not known to have ended after 0.3 s: .* does not answer"):
        client.wait(job, 0.3)
    assert time.monotonic() - began < 25.0


def test_waiting_ends_in_time_though_the_service_hangs(
    connect: Any, scripted: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(transport, "GRACE", 0.1)
    server = scripted((200, {}, b"{}"), delay=60.0)
    began = time.monotonic()
    with pytest.raises(TimeoutError, match=r"job 0 is not known to have ended after 0.2 s"):
        connect(server.url).wait("0", 0.2)
    assert time.monotonic() - began < 25.0


def test_a_service_that_is_away_for_too_long_ends_the_waiting(connect: Any, me: Any, wire: Any) -> None:
    client = connect(wire.url, me.secret, retry=0.3)
    job = client.submit(me.dataset, **SPEC)
    wire.tear()
    with pytest.raises(ServiceUnreachableError, match="does not answer"):
        client.wait(job, 60.0)


def test_waiting_survives_a_service_that_is_started_again(
    connect: Any, me: Any, wire: Any, carried_out: Any, later: Any
) -> None:
    client = connect(wire.url, me.secret)
    job = client.submit(me.dataset, **SPEC)
    later(0.1, wire.outage, 0.3)
    later(0.2, carried_out, job)
    assert client.wait(job).state == JobState.SUCCEEDED


@pytest.mark.ci
def test_an_impatient_client_can_wait_for_a_job_that_does_nothing(
    connect: Any, service: Service, me: Any
) -> None:
    # The service must not hold an answer back for longer than the client waits for one.
    client = connect(service.url, me.secret, timeout=1.5, retry=0.0)
    job = client.submit(me.dataset, **SPEC)
    with pytest.raises(TimeoutError, match="is still queued"):
        client.wait(job, 2.0)


# By events.


def test_events_come_in_order_until_the_job_has_ended(
    client: Any, job: Any, carried_out: Any, later: Any
) -> None:
    later(0.05, carried_out, job, 0.02)
    events = list(client.events(job))
    assert seen(events) == happened()
    assert all(isinstance(event, Event) for event in events)
    assert events[1].data["attempt"] == 1
    assert [event.data["generation"] for event in events[2:-1]] == list(GENERATIONS)


def test_events_go_on_behind_a_number(client: Any, job: Any, carried_out: Any) -> None:
    carried_out(job)
    for after in (0, 4, 8, 9):
        assert seen(client.events(job, after)) == happened()[after:]


@pytest.mark.parametrize("passed", [999, 1300])
def test_events_neither_lack_nor_repeat_over_cut_lines(
    connect: Any, me: Any, wire: Any, client: Any, job: Any, carried_out: Any, passed: int
) -> None:
    carried_out(job)
    # The head of an answer takes some 800 bytes: some are cut in it, others in the middle of an event.
    wire.cuts = [passed, 40, 900]
    assert seen(connect(wire.url, me.secret).events(job)) == happened()
    assert wire.asked > 2


def test_events_go_on_when_a_service_comes_back(
    connect: Any, me: Any, wire: Any, job: Any, carried_out: Any, later: Any
) -> None:
    later(0.05, carried_out, job, 0.05)
    later(0.2, wire.outage, 0.2)
    assert seen(connect(wire.url, me.secret).events(job)) == happened()


def test_the_end_of_a_job_is_told_though_the_stream_ended_before(
    connect: Any, service: Service, me: Any, job: Any, carried_out: Any, later: Any
) -> None:
    def end_streams() -> None:
        # As a service does that is ending; the job ends before anybody has come back.
        carried_out(job)
        service.app.state.islands.hub.close()
        time.sleep(0.05)
        service.app.state.islands.hub.closed = False

    service.app.state.islands.hub.closed = False
    later(0.15, end_streams)
    assert seen(connect(service.url, me.secret).events(job)) == happened()


def test_a_line_that_is_quiet_for_long_is_taken_up_again(
    connect: Any, me: Any, wire: Any, job: Any, carried_out: Any, later: Any
) -> None:
    # Nothing comes for longer than the client tries again, before and after it is cut off.
    client = connect(wire.url, me.secret, retry=0.15)
    for seconds in (0.25, 0.5):
        later(seconds, wire.interrupt)
    later(0.55, carried_out, job)
    assert seen(client.events(job)) == happened()


def test_a_line_that_has_gone_silent_is_taken_up_again(
    connect: Any, service: Service, me: Any, job: Any, carried_out: Any, later: Any
) -> None:
    later(0.4, carried_out, job)
    assert seen(connect(service.url, me.secret, timeout=0.2, retry=0.3).events(job)) == happened()


def test_who_reads_slowly_loses_nothing(connect: Any, me: Any, wire: Any, job: Any, carried_out: Any) -> None:
    carried_out(job)
    wire.cuts = [1300]
    events = []
    for event in connect(wire.url, me.secret, retry=0.2).events(job):
        events.append(event)
        time.sleep(0.3 if event.number == 2 else 0.0)
    assert seen(events) == happened()


def test_events_of_a_service_that_stays_away_end_in_time(connect: Any, me: Any, wire: Any, job: Any) -> None:
    client = connect(wire.url, me.secret, retry=0.3)
    events = client.events(job)
    assert next(iter(events)).kind == "queued"
    wire.tear()
    with pytest.raises(ServiceUnreachableError, match="does not answer"):
        list(events)


def test_events_are_asked_for_again_when_the_service_has_time(connect: Any, scripted: Any) -> None:
    text = b"id: 1\nevent: succeeded\ndata: {}\n\n"
    server = scripted((503, {}, b"{}"), (429, {"Retry-After": "0"}, b"{}"), (200, {}, text), (204, {}, b""))
    assert seen(connect(server.url).events("0")) == [(1, "succeeded")]
    assert [headers["Last-Event-ID"] for *_, headers in server.asked] == ["0", "0", "0", "1"]
    with pytest.raises(ServiceError):
        list(connect(scripted((503, {"Retry-After": "9"}, b"{}")).url).events("0"))


def test_a_job_that_is_not_there_has_no_events(client: Any) -> None:
    with pytest.raises(ServiceError) as caught:
        list(client.events("nobody"))
    assert caught.value.type == "/problems/no-such-job"


def test_a_job_that_goes_away_ends_its_events(
    client: Any, job: Any, me: Any, service: Service, later: Any
) -> None:
    def forget() -> None:
        service.store.jobs.cancel(me.owner, job.id)
        service.store.jobs.delete(me.owner, job.id)

    later(0.15, forget)
    with pytest.raises(ServiceError, match="there is no job"):
        list(client.events(job))


def test_what_looks_like_a_line_s_end_ends_no_event(
    client: Any, job: Any, service: Service, claimed: Any
) -> None:
    text = "a\u2028b\x85c\r\nd\x0be\x1cf\n\ng\U0001f600"
    problem = {"type": "broken", "detail": text}
    service.store.leases.finish(claimed(job), JobOutcome(JobState.FAILED, problem=problem))
    *_, last = client.events(job)
    assert last.data["detail"] == text


def test_a_line_that_is_cut_within_a_letter_loses_nothing(
    connect: Any, me: Any, wire: Any, job: Any, service: Service, claimed: Any
) -> None:
    detail = "ü" * 500
    problem = {"type": "broken", "detail": detail}
    service.store.leases.finish(claimed(job), JobOutcome(JobState.FAILED, problem=problem))
    wire.cuts = [1500, 1501]  # one of them is the middle of a letter
    *_, last = connect(wire.url, me.secret).events(job)
    assert last.data["detail"] == detail
    assert wire.asked > 2


@pytest.mark.parametrize("size", [1, 2, 3, 7, 1000])
def test_events_do_not_depend_on_how_they_arrive(size: int) -> None:
    text = (
        ": alive\n\n" + 'id: 1\nevent: running\ndata: {"note": "ü: x"}\n\n' * 2 + "id: 9\nevent: prog"
    ).encode()
    lines = EventLines()
    found = [event for at in range(0, len(text), size) for event in lines.feed(text[at : at + size])]
    assert found == [Event(1, "running", {"note": "ü: x"})] * 2


def test_many_jobs_are_followed_at_once(service: Service, me: Any, carried_out: Any, later: Any) -> None:
    async def follow_all() -> list[list[tuple[int, str]]]:
        async with AsyncClient(service.url, me.secret) as client:
            jobs = [await client.submit(me.dataset, ["u_V"], "y_um") for _ in range(8)]
            later(0.1, lambda: [carried_out(each) for each in jobs])

            async def follow(one: Any) -> list[tuple[int, str]]:
                return seen([event async for event in client.events(one)])

            return await asyncio.gather(*map(follow, jobs))

    assert asyncio.run(follow_all()) == [happened()] * 8
