"""Contract of the store with webhooks: an outbox without losses, leases, retries, the limit of an owner."""

import json

import pytest

from islands_service.domain.job import JobState
from islands_service.domain.webhook import MAX_ATTEMPTS, WebhookNotFoundError, retry_delay
from islands_service.store import Store
from support.stores import (
    ALICE,
    BOB,
    EXPIRED,
    FAILED,
    LONG,
    at_once,
    claimed,
    contents,
    expire_webhooks,
    job_in,
    open_stores,
    submitted,
    turn_clock,
)

UNKNOWN = "0" * 32


ALL = ("job.succeeded", "job.failed", "job.cancelled")

URL = "https://hooks.example.org/a"


def created(store, owner=ALICE, events=ALL, most=10):
    return store.webhooks.create(owner, URL, events, most)[0]


def sent(store, webhook):
    """Return the event and the state of the deliveries of a webhook, newest first."""
    return [(each.event, each.state) for each in store.webhooks.deliveries(webhook.owner, webhook.id)]


@pytest.mark.parametrize("state", [JobState.SUCCEEDED, JobState.FAILED, JobState.CANCELLED])
def test_the_end_of_a_job_is_delivered_once_to_every_webhook_that_asks_for_it(store, state):
    everything, one = created(store), created(store, events=("job.failed",))
    other = created(store, BOB)
    job = job_in(store, state)
    event = f"job.{state}"
    assert sent(store, everything) == [(event, "pending")]
    assert sent(store, one) == ([(event, "pending")] if event == "job.failed" else [])
    assert sent(store, other) == []
    (due,) = {
        each.id: each for each in store.deliveries.claim(LONG, 10) if each.webhook == everything.id
    }.values()
    body = json.loads(due.body)
    assert body["type"] == event
    assert body["data"]["job"] == job.id
    assert body["data"]["state"] == state
    assert body["data"]["links"]["job"] == f"/v1/jobs/{job.id}"
    assert set(body["data"]) == {"job", "kind", "name", "state", "links"}


def test_a_change_that_is_rolled_back_leaves_no_delivery(store):
    """The delivery and the state of the job are written in one transaction."""
    webhook = created(store)
    job = submitted(store)
    lease = claimed(store)

    def broken(connection):
        from islands_service.store.job_rows import append_event, update_job

        append_event(connection, update_job(connection, job.id, state=JobState.FAILED), "failed")
        raise RuntimeError

    with pytest.raises(RuntimeError):
        store.database.write(broken)
    assert sent(store, webhook) == []
    store.leases.finish(lease, FAILED)
    assert sent(store, webhook) == [("job.failed", "pending")]


def test_a_process_that_ends_before_it_sends_leaves_the_delivery_to_the_next(database):
    with Store(database) as store:
        created(store)
        job = job_in(store, JobState.FAILED)
    with Store(database) as following:
        (due,) = following.deliveries.claim(LONG, 10)
        assert job.id in due.body


def test_a_delivery_that_was_interrupted_is_repeated_with_its_id(store):
    created(store)
    job_in(store, JobState.FAILED)
    (first,) = store.deliveries.claim(EXPIRED, 10)
    (second,) = store.deliveries.claim(LONG, 10)
    assert (second.id, second.body) == (first.id, first.body)
    assert (first.attempt, second.attempt) == (1, 2)
    # The first process was only slow: its outcome is ignored, and the lease of the second one stays.
    before = contents(store)
    store.deliveries.record(first, 500, "failed")
    assert contents(store) == before
    store.deliveries.record(second, 200, None)
    (delivery,) = store.webhooks.deliveries(ALICE, store.webhooks.all(ALICE)[0].id)
    assert (delivery.state, delivery.status, delivery.error, delivery.attempts) == ("delivered", 200, None, 2)


def test_a_webhook_is_sent_one_delivery_at_a_time(store):
    slow, other = created(store), created(store, BOB)
    for owner in (ALICE, ALICE, BOB):
        job_in(store, JobState.FAILED, owner)
    first = store.deliveries.claim(LONG, 10)
    assert {each.webhook for each in first} == {slow.id, other.id}
    assert store.deliveries.claim(LONG, 10) == ()
    (mine,) = (each for each in first if each.webhook == slow.id)
    store.deliveries.record(mine, 200, None)
    (second,) = store.deliveries.claim(LONG, 10)
    assert (second.webhook, second.attempt) == (slow.id, 1)
    assert second.id != mine.id


@pytest.mark.ci
def test_concurrent_processes_claim_no_delivery_twice(database):
    with open_stores(database) as stores:
        for _ in range(6):
            created(stores[0])
        job_in(stores[0], JobState.FAILED)
        claims = [lambda each=each: each.deliveries.claim(LONG, 3) for each in stores for _ in range(2)]
        found = [due.id for batch in at_once(claims) for due in batch]
        assert len(found) == len(set(found)) == 6


def test_a_failed_attempt_is_repeated_at_growing_intervals_over_hours(store):
    webhook = created(store)
    job_in(store, JobState.FAILED)
    intervals = []
    for attempt in range(1, MAX_ATTEMPTS + 1):
        (due,) = store.deliveries.claim(LONG, 10)
        assert due.attempt == attempt
        assert store.deliveries.record(due, 503, "away") == (attempt == MAX_ATTEMPTS)
        (delivery,) = store.webhooks.deliveries(ALICE, webhook.id)
        assert (delivery.status, delivery.error) == (503, "away")
        if delivery.next_attempt is not None:
            assert store.deliveries.claim(LONG, 10) == ()
            intervals.append(delivery.next_attempt - delivery.attempted)
        expire_webhooks(store)
    assert delivery.state == "failed"
    assert store.deliveries.claim(LONG, 10) == ()
    assert intervals == pytest.approx([retry_delay(number) for number in range(1, MAX_ATTEMPTS)], abs=0.5)
    assert intervals[0] < 10.0
    assert 12 * 3600 < sum(intervals) < 24 * 3600


def test_deliveries_are_sent_after_the_clock_has_gone_back(store):
    """Their times, and the lease of a process that has ended, would last for an hour more."""
    created(store)
    created(store, BOB)
    job_in(store, JobState.FAILED)
    job_in(store, JobState.FAILED, BOB)
    failed, interrupted = store.deliveries.claim(60.0, 10)
    store.deliveries.record(failed, 500, "away")
    assert store.deliveries.claim(60.0, 10) == ()
    store.deliveries.sweep(LONG)
    assert store.deliveries.claim(60.0, 10) == ()
    turn_clock(store, -3600.0)
    store.deliveries.sweep(LONG)
    found = store.deliveries.claim(60.0, 10)
    assert {(each.id, each.attempt) for each in found} == {(failed.id, 2), (interrupted.id, 2)}
    assert store.deliveries.claim(60.0, 10) == ()


@pytest.mark.parametrize("operation", ["delete", "deliveries"])
def test_a_webhook_of_another_owner_does_not_exist(store, operation):
    webhook = created(store)
    for owner, identity in ((BOB, webhook.id), (ALICE, UNKNOWN)):
        with pytest.raises(WebhookNotFoundError, match=f"there is no webhook '{identity}'"):
            getattr(store.webhooks, operation)(owner, identity)
    assert store.webhooks.all(BOB) == ()
    assert store.webhooks.all(ALICE) == (webhook,)
