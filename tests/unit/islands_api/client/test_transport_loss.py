"""What the client does when a line is cut, a service is away for a while, or has no time."""

import json
import time
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from typing import Any

import pytest

from islands_api.client import ServiceError, ServiceUnreachableError, calls, transport
from islands_service.domain.job import JobState
from islands_service.store.database import CommitUnknownError
from support.service import Service, served

pytestmark = pytest.mark.usefixtures("quick")

SPEC = {"inputs": ["u_V"], "output": "y_um"}
EMPTY = (200, {}, b'{"items": [], "next": null}')


def refused(status: int, after: object = None, kind: str = "too-many-requests") -> Any:
    """A problem, as the service tells it, and when to come back."""
    body = json.dumps({"type": f"/problems/{kind}", "detail": "not now"}).encode()
    return status, {} if after is None else {"Retry-After": str(after)}, body


def from_now(seconds: float) -> str:
    return format_datetime(datetime.now(UTC) + timedelta(seconds=seconds), usegmt=True)


# Lost answers.


@pytest.mark.parametrize("passed", [0, 12, 200], ids=["no answer", "half a status", "half a body"])
def test_a_lost_answer_makes_no_second_job(
    connect: Any, service: Service, me: Any, wire: Any, passed: int
) -> None:
    wire.cuts = [passed, passed]
    job = connect(wire.url, me.secret).submit(me.dataset, **SPEC)
    assert wire.asked == 3  # the first two were carried out, or would have been
    assert [found.id for found in service.store.jobs.page(me.owner).jobs] == [job.id]


def test_a_lost_answer_to_an_upload_makes_no_second_data_set(
    connect: Any, me: Any, wire: Any, tmp_path: Any
) -> None:
    path = tmp_path / "record.csv"
    path.write_bytes(b"u_V,y_um\n" + b"".join(b"%d.5,%d.25\n" % (k, k % 7) for k in range(99)))
    wire.cuts = [0]
    client = connect(wire.url, me.secret)
    dataset = client.upload(path)
    assert wire.asked == 2
    assert [found.id for found in client.datasets().items] == [dataset.id, me.dataset]


def test_a_lost_answer_to_a_cancellation_is_no_failure(client: Any, connect: Any, me: Any, wire: Any) -> None:
    job = client.submit(me.dataset, **SPEC)
    wire.cuts = [0]
    assert connect(wire.url, me.secret).cancel(job).state == JobState.CANCELLED
    assert client.job(job).version == 2  # once


def test_what_would_do_harm_is_not_sent_twice(client: Any, connect: Any, me: Any, wire: Any) -> None:
    job = client.cancel(client.submit(me.dataset, **SPEC))
    for call in ("resume", "delete"):
        wire.cuts, before = [0], wire.asked
        with pytest.raises(
            ServiceUnreachableError, match=r"broke off before it answered .*: it may have done what was asked"
        ):
            getattr(connect(wire.url, me.secret), call)(job)
        assert wire.asked == before + 1
        if call == "resume":
            assert client.job(job).state == JobState.QUEUED
            client.cancel(job)
    with pytest.raises(ServiceError, match="there is no job"):
        client.job(job)


def test_what_may_have_been_done_is_not_sent_twice(
    client: Any, connect: Any, me: Any, service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    job, asked = client.cancel(client.submit(me.dataset, **SPEC)), []

    def resume(*_: Any) -> None:
        asked.append(1)
        raise CommitUnknownError("the database went away")

    monkeypatch.setattr(service.store.jobs, "resume", resume)
    with pytest.raises(ServiceError, match="nobody knows whether it was written") as caught:
        client.resume(job)
    assert (caught.value.status, caught.value.type) == (504, "/problems/store-in-doubt")
    assert len(asked) == 1


def test_what_never_left_may_be_sent_again(client: Any, connect: Any, me: Any, wire: Any, later: Any) -> None:
    job = client.cancel(client.submit(me.dataset, **SPEC))
    wire.tear()
    later(0.2, wire.mend)
    assert connect(wire.url, me.secret).resume(job).state == JobState.QUEUED


# Away.


def test_a_service_that_comes_back_in_time_is_waited_for(
    connect: Any, me: Any, wire: Any, later: Any
) -> None:
    client = connect(wire.url, me.secret, retry=25.0)
    client.jobs()
    wire.tear()
    later(0.3, wire.mend)
    began = time.monotonic()
    assert client.submit(me.dataset, **SPEC).state == JobState.QUEUED
    assert time.monotonic() - began > 0.2


def test_a_service_that_stays_away_is_told_of_in_time(connect: Any, me: Any, wire: Any) -> None:
    client = connect(wire.url, me.secret, retry=0.3)
    client.jobs()
    wire.tear()
    began = time.monotonic()
    with pytest.raises(ServiceUnreachableError) as caught:
        client.jobs()
    assert 0.2 <= time.monotonic() - began < 25.0
    assert str(caught.value) == (
        f"the service at {wire.url} does not answer (Connection refused): is it running, and is this its "
        "address?"
    )


def test_nobody_waits_who_does_not_want_to(connect: Any, wire: Any, pauses: list[float]) -> None:
    wire.tear()
    with pytest.raises(ServiceUnreachableError):
        connect(wire.url, retry=0.0).jobs()
    assert pauses == []


def test_a_service_that_hangs_is_told_of(connect: Any, scripted: Any) -> None:
    server = scripted(EMPTY, delay=60.0)
    began = time.monotonic()
    with pytest.raises(ServiceUnreachableError, match=r"does not answer \(timed out|ReadTimeout\)"):
        connect(server.url, timeout=0.2, retry=0.1).jobs()
    assert time.monotonic() - began < 25.0


@pytest.mark.parametrize("url", ["127.0.0.1:8000", "localhost", "ftp://here", "http://", "http://[::1", ""])
def test_what_is_no_address_is_refused_at_once(connect: Any, url: str) -> None:
    with pytest.raises(Exception, match="write http://HOST:PORT") as caught:
        connect(url)
    assert type(caught.value).__name__ == "SettingsError"


# No time.


def test_a_service_that_has_no_time_is_asked_again_when_it_says(
    connect: Any, scripted: Any, pauses: list[float]
) -> None:
    server = scripted(refused(429, 1), refused(503), EMPTY)
    assert connect(server.url).jobs().items == ()
    first, second = pauses
    assert first >= 1.0
    assert second <= max(transport.DELAYS)


# Their moments stand in no test's name: every process that collects has its own.
@pytest.mark.parametrize(
    "after",
    ["soon", "-5", "", from_now(-3600.0), "1e9", "٣"],
    ids=["soon", "negative", "empty", "gone by", "no whole number", "foreign digit"],
)
def test_what_is_no_time_to_come_back_at_is_passed_over(
    connect: Any, scripted: Any, pauses: list[float], after: str
) -> None:
    server = scripted(refused(503, after.encode().decode("latin-1")), EMPTY)
    assert connect(server.url).jobs().items == ()
    assert [pause <= max(transport.DELAYS) for pause in pauses] == [True]


@pytest.mark.parametrize("after", [3, from_now(3600.0)], ids=["seconds", "moment"])
def test_who_cannot_wait_so_long_is_told_at_once(connect: Any, scripted: Any, after: object) -> None:
    server = scripted(refused(429, after, "quota-exceeded"), EMPTY)
    with pytest.raises(ServiceError, match="not now") as caught:
        connect(server.url).jobs()
    assert (caught.value.status, caught.value.type) == (429, "/problems/quota-exceeded")
    assert len(server.asked) == 1


def test_a_service_that_never_has_time_says_why_in_the_end(connect: Any, scripted: Any) -> None:
    server = scripted(refused(503, kind="store-unavailable"))
    with pytest.raises(ServiceError) as caught:
        connect(server.url, retry=0.2).jobs()
    assert caught.value.type == "/problems/store-unavailable"
    assert 1 < len(server.asked) < 5  # at 0, 0.03, 0.09, 0.19 seconds


def test_a_gateway_leaves_open_whether_it_was_done(connect: Any, scripted: Any) -> None:
    for status in (502, 504):
        server = scripted((status, {}, b"gateway"), (202, {}, b"{}"))
        with pytest.raises(ServiceError, match="gateway"):
            connect(server.url).resume("0")
        assert len(server.asked) == 1
        server = scripted((status, {}, b"gateway"), EMPTY)
        assert connect(server.url).jobs().items == ()


@pytest.mark.parametrize("status", [400, 404, 409, 422, 500, 507])
def test_a_refusal_is_not_asked_again(connect: Any, scripted: Any, status: int) -> None:
    server = scripted(refused(status, 0))
    with pytest.raises(ServiceError, match="not now"):
        connect(server.url).call(calls.job("0"))
    assert len(server.asked) == 1


@pytest.mark.nightly
def test_who_asks_too_much_is_served_when_the_service_says(connect: Any, tmp_path: Any) -> None:
    with served(tmp_path / "busy", rate=2.0, burst=1) as busy:
        _, secret = busy.store.keys.create("test", frozenset({"read"}))
        client = connect(busy.url, secret)
        began = time.monotonic()
        for _ in range(2):
            client.jobs()
        assert time.monotonic() - began > 0.4
        assert "429" in str(busy.logs)
