"""Behaviour of the clients with broken connections, outages and busy services."""

import json
import time
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from typing import Any

import pytest

from islands_api.client import ServiceError, ServiceUnreachableError, calls, transport
from islands_service.domain.job import JobState
from support.service import Service

pytestmark = pytest.mark.usefixtures("quick")

SPEC = {"inputs": ["u_V"], "output": "y_um"}
EMPTY = (200, {}, b'{"items": [], "next": null}')


def problem_answer(status: int, after: object = None, kind: str = "too-many-requests") -> Any:
    """Return an answer with a problem and a Retry-After header."""
    body = json.dumps({"type": f"/problems/{kind}", "detail": "not now"}).encode()
    return status, {} if after is None else {"Retry-After": str(after)}, body


def from_now(seconds: float) -> str:
    return format_datetime(datetime.now(UTC) + timedelta(seconds=seconds), usegmt=True)


# Lost answers.


@pytest.mark.parametrize("passed", [0, 12, 200], ids=["no answer", "half a status", "half a body"])
def test_lost_answer_to_a_submission_creates_no_second_job(
    connect: Any, service: Service, me: Any, wire: Any, passed: int
) -> None:
    wire.cuts = [passed, passed]
    job = connect(wire.url, me.secret).submit(me.dataset, **SPEC)
    assert wire.connections == 3  # the first two requests reached the service
    assert [found.id for found in service.store.jobs.page(me.owner).jobs] == [job.id]


@pytest.mark.ci
def test_lost_answer_to_an_upload_creates_no_second_data_set(
    connect: Any, me: Any, wire: Any, tmp_path: Any
) -> None:
    path = tmp_path / "record.csv"
    path.write_bytes(b"u_V,y_um\n" + b"".join(b"%d.5,%d.25\n" % (k, k % 7) for k in range(99)))
    wire.cuts = [0]
    client = connect(wire.url, me.secret)
    dataset = client.upload(path)
    assert wire.connections == 2
    assert [found.id for found in client.datasets().items] == [dataset.id, me.dataset]


def test_lost_answer_to_a_cancellation_is_not_an_error(client: Any, connect: Any, me: Any, wire: Any) -> None:
    job = client.submit(me.dataset, **SPEC)
    wire.cuts = [0]
    assert connect(wire.url, me.secret).cancel(job).state == JobState.CANCELLED
    assert client.job(job).version == 2  # cancelled once


def test_non_idempotent_call_is_not_repeated(client: Any, connect: Any, me: Any, wire: Any) -> None:
    job = client.cancel(client.submit(me.dataset, **SPEC))
    for call in ("resume", "delete"):
        wire.cuts, before = [0], wire.connections
        with pytest.raises(
            ServiceUnreachableError,
            match=r"closed the connection before it answered .*: the call may have been carried out",
        ):
            getattr(connect(wire.url, me.secret), call)(job)
        assert wire.connections == before + 1
        if call == "resume":
            assert client.job(job).state == JobState.QUEUED
            client.cancel(job)
    with pytest.raises(ServiceError, match="there is no job"):
        client.job(job)


# Outages.


def test_long_outage_raises_an_error_in_time(connect: Any, me: Any, wire: Any) -> None:
    client = connect(wire.url, me.secret, retry=0.3)
    client.jobs()
    wire.tear()
    began = time.monotonic()
    with pytest.raises(ServiceUnreachableError) as caught:
        client.jobs()
    assert 0.2 <= time.monotonic() - began < 25.0
    assert str(caught.value) == (
        f"the service at {wire.url} does not answer (Connection refused): check that it runs and that the "
        "address is right"
    )


@pytest.mark.parametrize("url", ["127.0.0.1:8000", "localhost", "ftp://here", "http://", "http://[::1", ""])
def test_malformed_address_is_rejected_immediately(connect: Any, url: str) -> None:
    with pytest.raises(Exception, match="write http://HOST:PORT") as caught:
        connect(url)
    assert type(caught.value).__name__ == "SettingsError"


# Busy services.


def test_call_is_repeated_after_the_requested_delay(connect: Any, scripted: Any, pauses: list[float]) -> None:
    server = scripted(problem_answer(429, 1), problem_answer(503), EMPTY)
    assert connect(server.url).jobs().items == ()
    first, second = pauses
    assert first >= 1.0
    assert second <= max(transport.RETRY_DELAYS)


@pytest.mark.parametrize("after", [3, from_now(3600.0)], ids=["seconds", "date"])
def test_delay_beyond_the_retry_time_fails_immediately(connect: Any, scripted: Any, after: object) -> None:
    server = scripted(problem_answer(429, after, "quota-exceeded"), EMPTY)
    with pytest.raises(ServiceError, match="not now") as caught:
        connect(server.url).jobs()
    assert (caught.value.status, caught.value.type) == (429, "/problems/quota-exceeded")
    assert len(server.requests) == 1


@pytest.mark.parametrize("status", [400, 404, 409, 422, 500, 507])
def test_permanent_problem_is_not_repeated(connect: Any, scripted: Any, status: int) -> None:
    server = scripted(problem_answer(status, 0))
    with pytest.raises(ServiceError, match="not now"):
        connect(server.url).call(calls.job("0"))
    assert len(server.requests) == 1
