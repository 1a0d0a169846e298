"""Webhooks after a kill: between the end of a job and its delivery, and during the delivery."""

import asyncio
from collections import Counter
from contextlib import suppress

import pytest

from islands_service import delivery_sender
from islands_service.delivery_sender import DeliverySender
from islands_service.domain.job import JobState
from islands_service.outbound import CheckedClient
from islands_service.store import Store
from support.processes import eventually
from support.receivers import receiving
from support.stores import ALICE, child, expire_webhooks, job_in

pytestmark = pytest.mark.ci

#: Ends a job and is killed before it could do anything else.
FINISH = """
import os, signal, sys
from islands_service.domain.job import JobOutcome, JobState
from islands_service.store import Store
store = Store(sys.argv[1])
store.leases.finish(store.leases.claim("killed", 60.0), JobOutcome(JobState.FAILED, problem={}))
os.kill(os.getpid(), signal.SIGKILL)
"""

#: Sends deliveries until it is killed.
SEND = """
import asyncio, sys
from islands_service.outbound import CheckedClient
from islands_service.delivery_sender import DeliverySender
from islands_service.store import Store
store = Store(sys.argv[1])
client = CheckedClient(("127.0.0.1",), ("127.0.0.1",))
asyncio.run(DeliverySender(store.deliveries, client, asyncio.to_thread, lambda *_: None).run())
"""


def send(stores, done):
    """Send deliveries from one sender for each store until a condition is true; return the outcomes."""
    outcomes = Counter()

    async def run():
        client = CheckedClient(("127.0.0.1",), ("127.0.0.1",))
        senders = [
            DeliverySender(
                store.deliveries, client, asyncio.to_thread, lambda outcome, _: outcomes.update([outcome])
            )
            for store in stores
        ]
        tasks = [asyncio.create_task(sender.run()) for sender in senders]
        async with asyncio.timeout(60.0):
            while not await asyncio.to_thread(done):
                await asyncio.sleep(0.02)
        for task in tasks:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await task

    asyncio.run(run())
    return outcomes


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(delivery_sender, "POLL_SECONDS", 0.02)


def nothing_pending(store):
    return lambda: store.deliveries.pending().count == 0


def test_a_job_whose_process_is_killed_at_once_is_delivered_by_the_next(database):
    with receiving() as receiver, Store(database) as store:
        store.webhooks.create(ALICE, receiver.url, ("job.failed",), 1)
        job = job_in(store, JobState.QUEUED)
        with child(FINISH, database) as process:
            assert process.wait(60) == -9
        assert receiver.requests == []
        send([store], nothing_pending(store))
        ((_, _, body),) = receiver.requests
        assert job.id.encode() in body


def test_a_delivery_is_repeated_after_its_sender_was_killed(database):
    with receiving() as receiver, Store(database) as store:
        webhook, _ = store.webhooks.create(ALICE, receiver.url, ("job.failed",), 1)
        job_in(store, JobState.FAILED)
        receiver.answered.clear()
        with child(SEND, database) as process:
            eventually(lambda: receiver.requests)
            process.kill()
            process.wait(60)
        receiver.answered.set()
        (interrupted,) = store.webhooks.deliveries(ALICE, webhook.id)
        assert (interrupted.state, interrupted.attempts) == ("pending", 1)
        expire_webhooks(store)
        send([store], nothing_pending(store))
        assert len({headers["webhook-id"] for _, headers, _ in receiver.requests}) == 1
        assert len(receiver.requests) == 2


def test_two_senders_deliver_every_event_once(database):
    with receiving() as receiver, Store(database) as one, Store(database) as other:
        for owner in (ALICE, "second", "third"):
            one.webhooks.create(owner, receiver.url, ("job.cancelled",), 1)
            for _ in range(4):
                job_in(one, JobState.CANCELLED, owner)
        outcomes = send([one, other], nothing_pending(one))
        # The senders end when all are recorded, before the last is counted.
        assert set(outcomes) == {"delivered"}
        sent = Counter(headers["webhook-id"] for _, headers, _ in receiver.requests)
        assert len(sent) == 12
        assert set(sent.values()) == {1}
