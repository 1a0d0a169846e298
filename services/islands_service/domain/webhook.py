"""Webhooks: URLs that receive the events of an owner's jobs, and the deliveries of these events."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Any

from islands.errors import IslandsError
from islands_service.domain.job import TERMINAL

#: Event by the state that a job has reached.
EVENTS: Mapping[str, str] = {state: f"job.{state}" for state in TERMINAL}

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
        Some of `EVENTS`.
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
    document: dict[str, Any] = {
        "type": event,
        "timestamp": datetime.fromtimestamp(at, UTC).isoformat(timespec="milliseconds"),
        "data": {
            "job": job,
            "kind": kind,
            "name": name,
            "state": state,
            "links": {"job": path, "result": f"{path}/result", "report": f"{path}/report"},
        },
    }
    return json.dumps(document, ensure_ascii=False, separators=(",", ":"))
