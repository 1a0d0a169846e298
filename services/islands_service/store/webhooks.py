"""Webhooks of owners, and their deliveries: an outbox filled in the transaction that changes a job.

A process sends to a webhook while it holds its lease, ``busy_until``. Each webhook therefore receives one
request at a time, and a slow one delays no other. If the process ends, the lease expires, and the delivery is
repeated under the same id: at least once.
"""

import base64
import json
import secrets
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

from sqlalchemy import Connection, Row, delete, exists, func, insert, or_, select, update

from islands.errors import SettingsError, suggest
from islands_service.domain.job import QuotaError, Requester
from islands_service.domain.webhook import (
    EVENT_NAMES,
    EVENTS,
    Delivery,
    DueDelivery,
    Webhook,
    WebhookNotFoundError,
    make_body,
    retry_delay,
)
from islands_service.store import dialect
from islands_service.store.audit import Action, record_change
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.tables import deliveries, webhooks

#: Prefix of the secrets of webhooks (Standard Webhooks); the rest is the key in Base64.
SECRET_PREFIX = "whsec_"

#: Bytes of the key of a webhook.
_SECRET_BYTES = 32

#: Largest number of characters of an error that is kept.
_MAX_ERROR = 500

#: Webhooks with a delivery to send now.
_DUE_WEBHOOKS = select(webhooks).where(
    exists(
        select(deliveries.c.id).where(deliveries.c.webhook_id == webhooks.c.id, deliveries.c.next_at <= now())
    )
)


class Webhooks(DatabaseOperations):
    """Webhook operations of the store, used by the REST API on behalf of owners."""

    def create(
        self, owner: str, url: str, events: Sequence[str], most: int, by: Requester | None = None
    ) -> tuple[Webhook, str]:
        """Create a webhook; return it and its secret.

        The secret is stored as it is: an HMAC cannot be computed from a hash of its key.

        Parameters
        ----------
        url : str
            A URL that was checked by the caller.
        events : sequence of str
            Some of `EVENT_NAMES`.
        most : int
            Largest number of webhooks of an owner.

        Raises
        ------
        SettingsError
            An event is unknown, or none is given.
        QuotaError
            The owner has ``most`` webhooks.
        """
        unknown = [name for name in events if name not in EVENT_NAMES]
        if unknown or not events:
            raise SettingsError(
                f"unknown events {', '.join(map(str, unknown)) or '(none)'}: take some of "
                f"{', '.join(EVENT_NAMES)}{suggest(unknown[0], EVENT_NAMES) if unknown else ''}"
            )
        secret = SECRET_PREFIX + base64.b64encode(secrets.token_bytes(_SECRET_BYTES)).decode()

        def operation(connection: Connection) -> Webhook:
            dialect.lock_owner(connection, owner)
            present = connection.execute(
                select(func.count()).select_from(webhooks).where(webhooks.c.owner == owner)
            ).scalar_one()
            if present >= most:
                raise QuotaError(f"{present} webhooks exist, and {most} is the most: delete one first")
            values = {
                "id": uuid4().hex,
                "owner": owner,
                "url": url,
                "events": json.dumps(sorted(set(events))),
                "secret": secret,
                "created": now(),
            }
            row = connection.execute(insert(webhooks).values(values).returning(webhooks)).one()
            # The path of a URL may contain a secret of the receiver.
            details = json.dumps({"host": urlsplit(url).hostname})
            record_change(connection, Action.CREATE_WEBHOOK, owner, row.id, by, details)
            return _make_webhook(row)

        return self._database.write(operation), secret

    def all(self, owner: str) -> tuple[Webhook, ...]:
        """Return the webhooks of an owner, oldest first."""
        query = select(webhooks).where(webhooks.c.owner == owner).order_by(webhooks.c.created, webhooks.c.id)
        with self._database.read() as connection:
            return tuple(map(_make_webhook, connection.execute(query)))

    def delete(self, owner: str, webhook: str, by: Requester | None = None) -> None:
        """Delete a webhook with its deliveries. A request that is being sent is not interrupted.

        Raises
        ------
        WebhookNotFoundError
        """

        def operation(connection: Connection) -> None:
            _check_owned(connection, owner, webhook)
            connection.execute(delete(webhooks).where(webhooks.c.id == webhook))
            record_change(connection, Action.DELETE_WEBHOOK, owner, webhook, by)

        self._database.write(operation, urgent=True)

    def deliveries(self, owner: str, webhook: str, most: int = 100) -> tuple[Delivery, ...]:
        """Return the last deliveries of a webhook, newest first.

        Raises
        ------
        WebhookNotFoundError
        """
        query = (
            select(deliveries)
            .where(deliveries.c.webhook_id == webhook)
            .order_by(deliveries.c.created.desc(), deliveries.c.id.desc())
            .limit(most)
        )
        with self._database.read() as connection:
            _check_owned(connection, owner, webhook)
            return tuple(map(delivery_from_row, connection.execute(query)))


def _check_owned(connection: Connection, owner: str, webhook: str) -> None:
    query = select(webhooks.c.id).where(webhooks.c.id == webhook, webhooks.c.owner == owner)
    if connection.execute(query).one_or_none() is None:
        raise WebhookNotFoundError(f"there is no webhook {webhook!r}: list them with GET /v1/webhooks")


def _make_webhook(row: Row[Any]) -> Webhook:
    return Webhook(row.id, row.owner, row.url, tuple(json.loads(row.events)), row.created)


@dataclass(frozen=True, slots=True)
class PendingDeliveries:
    """Number of the deliveries that are not finished, and seconds since the creation of the oldest one."""

    count: int
    oldest: float


def queue_deliveries(connection: Connection, job: Row[Any]) -> None:
    """Add the event of a job that has ended to the outbox of its owner's webhooks."""
    event = EVENTS[job.state]
    body = make_body(event, job.id, job.kind, job.name, job.state, job.updated)
    queue_event(connection, event, job.owner, job.id, body, job.updated)


def queue_event(connection: Connection, event: str, owner: str, job: str, body: str, at: float) -> None:
    """Add an event to the outbox of the webhooks of an owner that ask for it."""
    found = connection.execute(
        select(webhooks.c.id, webhooks.c.events).where(webhooks.c.owner == owner)
    ).all()
    for webhook in found:
        if event in json.loads(webhook.events):
            values = {
                "id": uuid4().hex,
                "webhook_id": webhook.id,
                "event": event,
                "job_id": job,
                "body": body,
                "attempts": 0,
                "created": at,
                "next_at": at,
            }
            connection.execute(insert(deliveries), values)


class Deliveries(DatabaseOperations):
    """Delivery operations of the store, used by the process that sends."""

    def claim(self, seconds: float, most: int) -> tuple[DueDelivery, ...]:
        """Claim the oldest due delivery of each webhook to which no process is sending.

        The webhooks that have waited longest come first.

        Parameters
        ----------
        seconds : float
            Time after which the webhook can be claimed again if `record` was not called.
        most : int
            Largest number of deliveries.
        """
        # A lease that lasts for longer was given before the clock of the database went back.
        free = _DUE_WEBHOOKS.where(
            or_(webhooks.c.busy_until <= now(), webhooks.c.busy_until > now() + seconds + 1.0)
        )
        with self._database.read() as connection:
            if connection.execute(free.limit(1)).one_or_none() is None:
                return ()

        def operation(connection: Connection) -> tuple[DueDelivery, ...]:
            ordered = free.order_by(webhooks.c.busy_until, webhooks.c.id).limit(most)
            rows = connection.execute(ordered.with_for_update(skip_locked=True)).all()
            return tuple(_lease_webhook(connection, row, seconds) for row in rows)

        return self._database.write(operation)

    def record(self, due: DueDelivery, status: int | None, error: str | None) -> bool:
        """Store the outcome of an attempt; return whether the delivery is finished.

        A failed attempt is repeated after `retry_delay`. Nothing changes if another process has claimed the
        delivery since.

        Parameters
        ----------
        status : int or None
            HTTP status of the response.
        error : str or None
            Why the attempt has failed; None if it has succeeded.
        """
        delay = None if error is None else retry_delay(due.attempt)

        def operation(connection: Connection) -> None:
            held = (deliveries.c.id == due.id) & (deliveries.c.attempts == due.attempt)
            connection.execute(
                update(deliveries)
                .where(held, deliveries.c.next_at.is_not(None))
                .values(
                    next_at=None if delay is None else now() + delay,
                    delivered=now() if error is None else None,
                    status=status,
                    error=None if error is None else error[:_MAX_ERROR],
                )
            )
            leased = (webhooks.c.id == due.webhook) & (webhooks.c.busy_until == due.leased_until)
            connection.execute(update(webhooks).where(leased).values(busy_until=now()))

        self._database.write(operation)
        return delay is None

    def pending(self) -> PendingDeliveries:
        """Return the number and the age of the deliveries of all owners that are not finished."""
        unfinished = deliveries.c.next_at.is_not(None)
        query = select(func.count(), func.coalesce(now() - func.min(deliveries.c.created), 0.0))
        with self._database.read() as connection:
            count, oldest = connection.execute(query.where(unfinished)).one()
        return PendingDeliveries(count, oldest)

    def sweep(self, seconds: float) -> None:
        """Delete the finished deliveries that were created more than the given seconds ago.

        If the clock of the database has gone back by more than a second since the last attempt at an
        unfinished one, its next attempt may lie far in the future: it is made now.
        """
        unfinished = deliveries.c.next_at.is_not(None)
        changed = func.coalesce(deliveries.c.attempted, deliveries.c.created)

        def operation(connection: Connection) -> None:
            connection.execute(delete(deliveries).where(~unfinished, deliveries.c.created < now() - seconds))
            late = update(deliveries).where(unfinished, changed > now() + 1.0)
            connection.execute(late.values(next_at=now()))

        self._database.write(operation, urgent=True)


def delivery_from_row(row: Row[Any]) -> Delivery:
    """Return the `Delivery` of a row."""
    finished = "failed" if row.delivered is None else "delivered"
    return Delivery(
        row.id,
        row.event,
        row.job_id,
        finished if row.next_at is None else "pending",
        row.attempts,
        row.created,
        row.attempted,
        row.next_at,
        row.status,
        row.error,
    )


def _lease_webhook(connection: Connection, webhook: Row[Any], seconds: float) -> DueDelivery:
    """Lease a webhook, and begin an attempt at its oldest due delivery."""
    first = (
        select(deliveries.c.id)
        .where(deliveries.c.webhook_id == webhook.id, deliveries.c.next_at <= now())
        .order_by(deliveries.c.next_at, deliveries.c.id)
        .limit(1)
    )
    begun = connection.execute(
        update(deliveries)
        .where(deliveries.c.id == first.scalar_subquery())
        .values(attempts=deliveries.c.attempts + 1, attempted=now())
        .returning(deliveries)
    ).one()
    leased = connection.execute(
        update(webhooks)
        .where(webhooks.c.id == webhook.id)
        .values(busy_until=now() + seconds)
        .returning(webhooks.c.busy_until)
    ).scalar_one()
    return DueDelivery(begun.id, webhook.id, webhook.url, webhook.secret, begun.body, begun.attempts, leased)
