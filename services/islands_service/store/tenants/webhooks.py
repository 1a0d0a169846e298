"""Webhooks of owners: create, list, delete, and read their deliveries."""

import base64
import json
import secrets
from collections.abc import Sequence
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

from sqlalchemy import Connection, Row, delete, func, insert, select

from islands.errors import SettingsError, suggest
from islands_service.domain.job import QuotaError, Requester
from islands_service.domain.webhook import EVENT_NAMES, Delivery, Webhook, WebhookNotFoundError
from islands_service.store.audit import Action, record_change
from islands_service.store.backends import dialect
from islands_service.store.backends.dialect import now
from islands_service.store.database import Database
from islands_service.store.tables import deliveries, webhooks
from islands_service.store.tenants.deliveries import delivery_from_row

#: Prefix of the secrets of webhooks (Standard Webhooks); the rest is the key in Base64.
SECRET_PREFIX = "whsec_"

#: Bytes of the key of a webhook.
_SECRET_BYTES = 32


class Webhooks:
    """Webhook operations of the store, used by the REST API on behalf of owners.

    Parameters
    ----------
    database : Database
    """

    def __init__(self, database: Database) -> None:
        self._database = database

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
