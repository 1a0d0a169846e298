"""Webhooks over REST: registration, limits, and signed requests to a receiver on this machine."""

import base64
import hashlib
import hmac
import json
from time import time

import pytest
from sqlalchemy import update

from islands_api.client import Client
from islands_api.web.auth import LOCAL_OWNER
from islands_service import delivery_sender
from islands_service.domain.job import JobState
from islands_service.store.tables import deliveries as deliveries_table
from support.processes import eventually
from support.receivers import receiving
from support.service import emptied, problem_of
from support.stores import job_in

EVENTS = ["job.succeeded", "job.failed", "job.cancelled", "monitor.alarm"]


@pytest.fixture(scope="module")
def shared(serve):
    patch = pytest.MonkeyPatch()
    patch.setattr(delivery_sender, "POLL_SECONDS", 0.02)
    with serve(private_hosts="127.0.0.1", http_hosts="127.0.0.1", max_webhooks=2) as running:
        yield running
    patch.undo()


@pytest.fixture
def service(shared):
    return emptied(shared)


@pytest.fixture
def receiver():
    with receiving() as running:
        yield running


def register(service, url, **changes):
    answer = service.client.post("/v1/webhooks", json={"url": url, **changes})
    assert answer.status_code == 201, answer.text
    return answer.json()


def last_delivery(service, webhook):
    found = service.client.get(f"/v1/webhooks/{webhook['id']}/deliveries").json()["items"]
    return found[0] if found else None


def delivered(service, webhook, state="delivered"):
    """Wait for the state of the newest delivery; return the delivery."""
    eventually(lambda: (last_delivery(service, webhook) or {}).get("state") == state)
    return last_delivery(service, webhook)


def test_the_client_creates_lists_and_deletes_webhooks(service, receiver):
    with Client(service.url) as client:
        other, made = client.create_webhook(receiver.url), client.create_webhook(receiver.url, ["job.failed"])
        assert other.events == tuple(sorted(EVENTS))
        assert [each.id for each in client.webhooks()] == [other.id, made.id]
        for state in (JobState.SUCCEEDED, JobState.FAILED):
            job = job_in(service.store, state, LOCAL_OWNER)
        (delivery,) = eventually(lambda: client.deliveries(made.id))
        assert (delivery.event, delivery.job) == ("job.failed", job.id)
        client.delete_webhook(other)
        assert [each.id for each in client.webhooks()] == [made.id]


def test_the_secret_of_a_webhook_is_shown_once(service, receiver):
    made = service.client.post("/v1/webhooks", json={"url": receiver.url})
    assert made.headers["cache-control"] == "no-store"
    webhook = made.json()
    assert webhook["events"] == sorted(EVENTS)
    assert len(base64.b64decode(webhook.pop("secret").removeprefix("whsec_"))) == 32
    assert service.client.get("/v1/webhooks").json() == {"items": [webhook]}
    assert service.client.delete(f"/v1/webhooks/{webhook['id']}").status_code == 204
    assert service.client.get("/v1/webhooks").json() == {"items": []}


def test_a_finished_job_is_sent_with_a_signature_that_the_receiver_can_verify(service, receiver):
    """The signature is computed here from the text of the standard, not with the code of the service."""
    webhook = register(service, receiver.url)
    job = job_in(service.store, JobState.SUCCEEDED, "local", name="Bühne 1")
    delivery = delivered(service, webhook)
    assert (delivery["event"], delivery["job"], delivery["attempts"]) == ("job.succeeded", job.id, 1)
    ((path, headers, body),) = receiver.requests
    assert path == "/hook"
    assert headers["Content-Type"] == "application/json"
    assert headers["webhook-id"] == delivery["id"]
    assert abs(int(headers["webhook-timestamp"]) - time()) < 60
    key = base64.b64decode(webhook["secret"].removeprefix("whsec_"))
    signed = b".".join((headers["webhook-id"].encode(), headers["webhook-timestamp"].encode(), body))
    expected = base64.b64encode(hmac.digest(key, signed, hashlib.sha256)).decode()
    assert headers["webhook-signature"] == f"v1,{expected}"
    assert json.loads(body)["data"]["name"] == "Bühne 1"
    for link in ("job", "result"):
        assert service.client.get(json.loads(body)["data"]["links"][link]).status_code == 200


@pytest.mark.parametrize("status", [302, 410, 500])
def test_a_refused_event_is_sent_again_with_the_same_id_and_body(service, receiver, status):
    webhook = register(service, receiver.url)
    receiver.answers = [status]
    job_in(service.store, JobState.FAILED, "local")
    eventually(lambda: (last_delivery(service, webhook) or {}).get("error"))
    delivery = last_delivery(service, webhook)
    assert (delivery["state"], delivery["status"]) == ("pending", status)
    assert f"status {status}" in delivery["error"]
    assert delivery["next_attempt"] > delivery["attempted"]
    service.store.database.write(
        lambda connection: connection.execute(update(deliveries_table).values(next_at=0.0))
    )
    assert delivered(service, webhook)["attempts"] == 2
    (_, first, body), (_, second, again) = receiver.requests
    assert (first["webhook-id"], body) == (second["webhook-id"], again)


def test_a_dead_endpoint_delays_neither_others_nor_the_answers_of_the_service(service, receiver):
    receiver.answered.clear()
    slow = register(service, receiver.url)
    with receiving() as quick:
        other = register(service, quick.url)
        for _ in range(3):
            job_in(service.store, JobState.CANCELLED, "local")
        eventually(lambda: len(quick.requests) == 3)
        delivered(service, other)
    assert len(receiver.requests) == 1
    receiver.answered.set()
    eventually(lambda: len(receiver.requests) == 3)
    delivered(service, slow)


@pytest.mark.parametrize(
    ("body", "kind"),
    [
        ({"url": "http://example.org/"}, "invalid-settings"),
        ({"url": "https://10.0.0.1/"}, "invalid-settings"),
        ({"url": "https://localhost/"}, "invalid-settings"),
        ({"url": "https://[::1]/"}, "invalid-settings"),
        ({"url": "https://169.254.169.254/latest"}, "invalid-settings"),
        ({"url": "https://me:secret@1.1.1.1/"}, "invalid-settings"),
        ({"url": "https://no-such-name.invalid/"}, "invalid-settings"),
        ({"url": "https://1.1.1.1/", "events": ["job.started"]}, "invalid-settings"),
        ({"url": "https://1.1.1.1/", "events": []}, "invalid-request"),
        ({"url": "https://1.1.1.1/\nX: y"}, "invalid-request"),
        ({"url": "https://1.1.1.1/", "secret": "mine"}, "invalid-request"),
        ({}, "invalid-request"),
    ],
)
def test_a_webhook_that_cannot_be_used_is_refused(service, body, kind):
    problem_of(service.client.post("/v1/webhooks", json=body), 422, kind)
    assert service.client.get("/v1/webhooks").json() == {"items": []}
