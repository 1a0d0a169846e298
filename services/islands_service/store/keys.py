"""API keys: shown once, stored as hashes, revocable, with an optional expiry."""

import hashlib
import json
import re
import secrets
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Column, Connection, Row, func, insert, or_, select, update

from islands.errors import IslandsError, SettingsError, suggest
from islands_service.domain.job import Requester
from islands_service.store import dialect
from islands_service.store.audit import Action, record_change
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.tables import keys

#: Scopes of a key, and what each allows.
SCOPES = {
    "read": "read your own data sets, jobs and results",
    "write": "upload data sets, submit, cancel, stop, resume and delete jobs",
    "metrics": "read the service's metrics",
    "admin": "manage keys, and the weights and quotas of owners",
}

#: Prefix of every key, by which scanners for leaked secrets can detect it.
PREFIX = "islands_"

#: Id and owner of the key in the file of the operator.
ADMIN_KEY = "admin-key-file"

#: Origin of the changes of this key in the audit trail.
_ADMIN_KEY_FILE = Requester("ISLANDS_ADMIN_KEY_FILE")

_ADMIN_SECRET = re.compile(r"[\x21-\x7e]{32,}")


class KeyNotFoundError(IslandsError):
    """There is no key with this id."""


@dataclass(frozen=True, slots=True)
class Key:
    """An API key without its secret.

    Attributes
    ----------
    owner : str
        Owner of the data sets and jobs that the key gives access to; several keys may have the same owner.
    expired : bool
        Whether the key had expired by the clock of the database when it was read.
    """

    id: str
    owner: str
    name: str
    scopes: frozenset[str]
    created: float
    expires: float | None
    revoked: float | None
    expired: bool

    @property
    def valid(self) -> bool:
        """Whether the key is neither revoked nor expired."""
        return self.revoked is None and not self.expired


class Keys(DatabaseOperations):
    """Key operations of the store."""

    def create(
        self,
        name: str,
        scopes: frozenset[str],
        owner: str | None = None,
        seconds: float | None = None,
        by: Requester | None = None,
    ) -> tuple[Key, str]:
        """Create a key, with a new owner unless one is given; return the key and its secret.

        Raises
        ------
        SettingsError
            A scope is unknown, no scope is given, or the name or the owner is too long.
        """
        unknown = sorted(scopes - set(SCOPES))
        if unknown or not scopes:
            raise SettingsError(
                f"unknown scopes {', '.join(unknown) or '(none)'}: take some of {', '.join(SCOPES)}"
                f"{suggest(unknown[0], SCOPES) if unknown else ''}"
            )
        _check_length("name", name, keys.c.name)
        _check_length("owner", owner or "", keys.c.owner)
        identity = secrets.token_hex(8)
        secret = PREFIX + secrets.token_urlsafe(32)

        def operation(connection: Connection) -> Key:
            values = {
                "id": identity,
                "owner": owner or f"key-{identity}",
                "name": name,
                "secret_sha256": _hash(secret),
                "scopes": json.dumps(sorted(scopes)),
                "created": now(),
                "expires": None if seconds is None else now() + seconds,
            }
            connection.execute(insert(keys).values(values))
            record_change(connection, Action.CREATE_KEY, str(values["owner"]), identity, by)
            return _make_key(connection.execute(_query().where(keys.c.id == identity)).one())

        return self._database.write(operation), secret

    def install_admin_key(self, secret: str | None) -> bool:
        """Make a secret that the operator has chosen the key `ADMIN_KEY`, or revoke that key if None.

        Another secret replaces the previous one, which is then unknown. A key that was revoked stays revoked
        until the secret changes. Return whether it is not revoked.

        Raises
        ------
        SettingsError
            The secret is too short or has invalid characters, or is that of another key.
        """
        if secret is not None and not _ADMIN_SECRET.fullmatch(secret):
            raise SettingsError(
                "the key of ISLANDS_ADMIN_KEY_FILE has at least 32 printable characters without spaces: make "
                "one with 'openssl rand -hex 32'"
            )

        def operation(connection: Connection) -> bool:
            dialect.lock_owner(connection, ADMIN_KEY)
            current = connection.execute(select(keys).where(keys.c.id == ADMIN_KEY)).one_or_none()
            if secret is None:
                if current is not None and current.revoked is None:
                    connection.execute(update(keys).where(keys.c.id == ADMIN_KEY).values(revoked=now()))
                    record_change(connection, Action.REVOKE_KEY, ADMIN_KEY, ADMIN_KEY, _ADMIN_KEY_FILE)
                return False
            digest = _hash(secret)
            same = connection.execute(select(keys.c.id).where(keys.c.secret_sha256 == digest)).scalar()
            if current is not None and same == ADMIN_KEY:
                return current.revoked is None
            if same is not None:
                raise SettingsError(
                    f"the key of ISLANDS_ADMIN_KEY_FILE is that of the key {same}: choose another one"
                )
            values = {
                "owner": ADMIN_KEY,
                "name": "ISLANDS_ADMIN_KEY_FILE",
                "secret_sha256": digest,
                "scopes": json.dumps(["admin"]),
                "created": now(),
                "revoked": None,
            }
            dialect.upsert(connection, keys, {"id": ADMIN_KEY}, values)
            record_change(connection, Action.CREATE_KEY, ADMIN_KEY, ADMIN_KEY, _ADMIN_KEY_FILE)
            return True

        return self._database.write(operation)

    def find(self, secret: str) -> Key | None:
        """Return the key of a secret, even if it is expired or revoked; None if the secret is wrong.

        A secret has 256 random bits, or was chosen by the operator to be as good, so that a plain hash
        reveals nothing about it, and a lookup by the hash takes the same time for every wrong secret.
        """
        with self._database.read() as connection:
            row = connection.execute(_query().where(keys.c.secret_sha256 == _hash(secret))).one_or_none()
        return None if row is None else _make_key(row)

    def all(self) -> tuple[Key, ...]:
        """Return all keys, oldest first."""
        with self._database.read() as connection:
            return tuple(map(_make_key, connection.execute(_query().order_by(keys.c.created, keys.c.id))))

    def revoke(self, key: str, by: Requester | None = None) -> Key:
        """Revoke a key with immediate effect.

        Raises
        ------
        KeyNotFoundError
        """

        def operation(connection: Connection) -> Key:
            connection.execute(
                update(keys).where(keys.c.id == key).values(revoked=func.coalesce(keys.c.revoked, now()))
            )
            row = connection.execute(_query().where(keys.c.id == key)).one_or_none()
            if row is None:
                raise KeyNotFoundError(f"there is no key {key!r}: list them with 'islands admin keys'")
            record_change(connection, Action.REVOKE_KEY, row.owner, key, by)
            return _make_key(row)

        return self._database.write(operation, urgent=True)

    def any_valid(self) -> bool:
        """Return whether at least one key is valid."""
        valid = keys.c.revoked.is_(None) & or_(keys.c.expires.is_(None), keys.c.expires > now())
        with self._database.read() as connection:
            return connection.execute(select(keys.c.id).where(valid).limit(1)).scalar() is not None


def _check_length(what: str, text: str, column: Column[str]) -> None:
    # SQLite would store it, and the error of PostgreSQL would not name the column.
    most = column.type.length  # type: ignore[attr-defined]
    if len(text) > most:
        raise SettingsError(
            f"the {what} of a key has at most {most} characters, this one has {len(text)}: take a shorter one"
        )


def _hash(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()


def _query() -> Any:
    return select(keys, (keys.c.expires <= now()).label("expired"))


def _make_key(row: Row[Any]) -> Key:
    return Key(
        row.id,
        row.owner,
        row.name,
        frozenset(json.loads(row.scopes)),
        row.created,
        row.expires,
        row.revoked,
        bool(row.expired),
    )
