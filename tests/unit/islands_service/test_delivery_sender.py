"""Sender of webhooks: the signature of the standard, short claims, and failures of receivers and database."""

import asyncio
from collections import Counter
from contextlib import asynccontextmanager, suppress
from types import SimpleNamespace

import structlog

from islands_service import delivery_sender
from islands_service.delivery_sender import DeliverySender, sign_request
from islands_service.domain.webhook import DueDelivery
from islands_service.store.database import StoreUnavailableError


def test_the_example_of_the_standard_has_its_signature():
    headers = sign_request(
        "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw",
        "msg_p5jXN8AQM9LWM0D4loKWxJek",
        1614265330,
        b'{"test": 2432232314}',
    )
    assert headers == {
        "webhook-id": "msg_p5jXN8AQM9LWM0D4loKWxJek",
        "webhook-timestamp": "1614265330",
        "webhook-signature": "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=",
    }


class _Deliveries:
    """Outbox with a due delivery of each of some webhooks; claims fail while ``away``."""

    def __init__(self, count):
        self.due = [
            DueDelivery(f"d{i}", f"w{i}", f"https://h{i}/", "whsec_AAAA", "{}", 1, 0.0) for i in range(count)
        ]
        self.claims, self.recorded, self.away = [], {}, 0

    def claim(self, _seconds, most):
        self.claims.append(most)
        if self.away:
            self.away -= 1
            raise StoreUnavailableError("the database does not answer")
        found, self.due = self.due[:most], self.due[most:]
        return tuple(found)

    def record(self, due, status, error):
        self.recorded[due.webhook] = status, error
        return error is None


class _Client:
    """Client of receivers, of which one fails with an error, one never answers, and the others accept."""

    def __init__(self, failing=None, silent=None):
        self.failing, self.silent = failing, silent

    @asynccontextmanager
    async def open(self, _method, url, *_):
        if url == self.failing:
            raise RuntimeError
        if url == self.silent:
            await asyncio.Event().wait()
        yield SimpleNamespace(status_code=204)


def send(deliveries, client, monkeypatch, until):
    """Run a sender until a condition is true; return the outcomes."""
    monkeypatch.setattr(delivery_sender, "POLL_SECONDS", 0.001)
    outcomes = Counter()

    async def run_blocking(operation, *arguments):
        return operation(*arguments)

    async def run():
        sender = DeliverySender(
            deliveries, client, run_blocking, lambda outcome, _: outcomes.update([outcome])
        )
        task = asyncio.create_task(sender.run())
        async with asyncio.timeout(30.0):
            while not until():
                await asyncio.sleep(0.001)
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        assert len(asyncio.all_tasks()) == 1

    asyncio.run(run())
    return outcomes


def test_a_receiver_that_never_answers_delays_no_other(monkeypatch):
    deliveries = _Deliveries(5)
    send(deliveries, _Client(silent="https://h0/"), monkeypatch, lambda: len(deliveries.recorded) == 4)
    assert "w0" not in deliveries.recorded


def test_a_defect_of_one_request_is_a_failed_attempt(monkeypatch):
    deliveries = _Deliveries(2)
    client = _Client(failing="https://h1/")
    outcomes = send(deliveries, client, monkeypatch, lambda: len(deliveries.recorded) == 2)
    assert outcomes == {"delivered": 1, "retried": 1}
    status, error = deliveries.recorded["w1"]
    assert status is None
    assert "unexpected error" in error


def test_the_sender_continues_after_an_outage_of_the_database_and_logs_it_once(monkeypatch):
    deliveries = _Deliveries(1)
    deliveries.away = 3
    with structlog.testing.capture_logs() as logs:
        assert send(deliveries, _Client(), monkeypatch, lambda: deliveries.recorded) == {"delivered": 1}
    assert [entry["event"] for entry in logs] == ["deliveries not read", "deliveries read again", "delivery"]
