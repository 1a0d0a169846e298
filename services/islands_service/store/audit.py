"""Audit trail: requested changes with their time, key and address. Entries are never changed.

An entry is written in the transaction of the change, so that neither exists without the other.
"""

from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from sqlalchemy import Connection, insert, select

from islands_service.domain.job import Requester
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.tables import audit


class Action(StrEnum):
    """Audited changes."""

    SUBMIT = "submit-job"
    CANCEL = "cancel-job"
    CANCEL_AS_ADMINISTRATOR = "cancel-job-as-administrator"
    STOP = "stop-job"
    RESUME = "resume-job"
    LABEL = "label-job"
    DELETE = "delete-job"
    UPLOAD = "upload-dataset"
    DELETE_DATASET = "delete-dataset"
    EXPIRE_DATASET = "expire-dataset"
    CREATE_KEY = "create-key"
    REVOKE_KEY = "revoke-key"
    CHANGE_OWNER = "change-owner"
    CREATE_WEBHOOK = "create-webhook"
    DELETE_WEBHOOK = "delete-webhook"
    CREATE_MONITOR = "create-monitor"
    DELETE_MONITOR = "delete-monitor"


@dataclass(frozen=True, slots=True)
class AuditEntry:
    """A requested change.

    Attributes
    ----------
    at : float
        Seconds since 1970 by the clock of the database.
    action : str
        One of `Action`; a newer version may have others.
    owner, subject : str
        Owner, and id, of the job, the data set, the monitor, the key or the webhook; the owner is its own
        subject.
    key_id : str or None
        Key of the request; None if it needed none.
    address : str
        Address of the client, ``command line``, or ``retention``.
    details : str or None
        New values of a changed owner, new name and tags of a job, the host of a new webhook, or the source of
        a data set, as JSON.
    """

    at: float
    action: str
    owner: str
    subject: str
    key_id: str | None
    address: str
    details: str | None = None


class AuditTrail(DatabaseOperations):
    """Read access to the audit trail."""

    def entries(
        self, owner: str | None = None, since: float | None = None, limit: int = 100
    ) -> tuple[AuditEntry, ...]:
        """Return the newest entries, newest first; those of an owner, and since a time, if given."""
        query = select(audit).order_by(audit.c.at.desc(), audit.c.number.desc()).limit(limit)
        if owner is not None:
            query = query.where(audit.c.owner == owner)
        if since is not None:
            query = query.where(audit.c.at >= since)
        with self._database.read() as connection:
            return tuple(
                AuditEntry(row.at, row.action, row.owner, row.subject, row.key_id, row.address, row.details)
                for row in connection.execute(query)
            )


#: Built once, since building the statement takes as long as executing it.
_INSERT_ENTRY = insert(audit).values(at=now())

#: Largest number of characters of an address.
_MAX_ADDRESS = 64


def record_change(
    connection: Connection,
    action: Action,
    owner: str,
    subject: str,
    by: Requester | None,
    details: str | None = None,
) -> None:
    """Add an entry in the transaction of the change. None is a change by the service itself."""
    if by is None:
        return
    values: dict[str, Any] = {
        "action": action,
        "owner": owner,
        "subject": subject,
        "key_id": by.key,
        "address": by.address[:_MAX_ADDRESS],
        "details": details,
    }
    connection.execute(_INSERT_ENTRY, values)
