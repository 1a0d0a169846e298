"""Webhooks: URLs that receive the events of an owner's jobs and monitors, and the deliveries of events."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from islands.errors import IslandsError
from islands_service.domain.job import MONITORING, TERMINAL

#: Event by the state that a job has reached.
EVENTS: Mapping[str, str] = {state: f"job.{state}" for state in TERMINAL}

#: Event of a record that raised an alarm of its monitor.
ALARM_EVENT = "monitor.alarm"

#: All events.
EVENT_NAMES = (*EVENTS.values(), ALARM_EVENT)

#: Seconds between the first two attempts; each further interval is `RETRY_FACTOR` times as long.
FIRST_RETRY = 5.0
RETRY_FACTOR = 4.0

#: Longest time between two attempts in seconds.
LAST_RETRY = 6 * 3600.0

#: Attempts after which a delivery has failed: the last one is made 19.6 hours after the first.
MAX_ATTEMPTS = 10


class WebhookNotFoundError(IslandsError):
    """The owner has no such webhook."""


@dataclass(frozen=True, slots=True)
class Webhook:
    """A webhook without its secret.

    Attributes
    ----------
    events : tuple of str
        Some of `EVENT_NAMES`.
    created : float
        Seconds since 1970.
    """

    id: str
    owner: str
    url: str
    events: tuple[str, ...]
    created: float


@dataclass(frozen=True, slots=True)
class Delivery:
    """An event that is sent to a webhook, with its last attempt.

    Attributes
    ----------
    state : str
        ``pending``, ``delivered`` or ``failed``.
    attempts : int
        Attempts that have begun.
    created, attempted, next_attempt : float or None
        Seconds since 1970. There is no next attempt of a delivered or failed one.
    status : int or None
        HTTP status of the last response.
    error : str or None
        Why the last attempt failed.
    """

    id: str
    event: str
    job: str
    state: str
    attempts: int
    created: float
    attempted: float | None
    next_attempt: float | None
    status: int | None
    error: str | None


@dataclass(frozen=True, slots=True)
class DueDelivery:
    """A delivery that was claimed for an attempt.

    Attributes
    ----------
    attempt : int
        Number of the attempt. A newer claim of the delivery has a higher one.
    leased_until : float
        Time until which no other process sends to the webhook.
    """

    id: str
    webhook: str
    url: str
    secret: str = field(repr=False)
    body: str
    attempt: int
    leased_until: float


def retry_delay(attempt: int) -> float | None:
    """Return the seconds between a failed attempt and the next one; None after the last attempt."""
    if attempt >= MAX_ATTEMPTS:
        return None
    return min(FIRST_RETRY * RETRY_FACTOR ** (attempt - 1), LAST_RETRY)


def make_body(event: str, job: str, kind: str, name: str, state: str, at: float) -> str:
    """Return the body of a delivery: which job has reached which state, and paths to read more. No data."""
    path = f"/v1/jobs/{job}"
    links = {"job": path, "result": f"{path}/result"}
    if kind != MONITORING:
        links["report"] = f"{path}/report"
    data = {"job": job, "kind": kind, "name": name, "state": state, "links": links}
    return _make_document(event, at, data)


def make_alarm_body(monitor: str, name: str, job: str, at: float) -> str:
    """Return the body of the delivery of an alarm: the monitor, and the job of the record. No data."""
    links = {
        "monitor": f"/v1/monitors/{monitor}",
        "job": f"/v1/jobs/{job}",
        "result": f"/v1/jobs/{job}/result",
    }
    data = {"monitor": monitor, "name": name, "job": job, "links": links}
    return _make_document(ALARM_EVENT, at, data)


def _make_document(event: str, at: float, data: Mapping[str, Any]) -> str:
    timestamp = datetime.fromtimestamp(at, UTC).isoformat(timespec="milliseconds")
    document = {"type": event, "timestamp": timestamp, "data": data}
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"))
