"""Uploaded data sets by owner. The bytes are blobs; the rows describe their content."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Row, delete, func, insert, select, tuple_

from islands.errors import IslandsError
from islands_service.domain.job import ACTIVE, QuotaError
from islands_service.store import dialect
from islands_service.store.database import Database
from islands_service.store.dialect import now
from islands_service.store.tables import datasets, jobs


class DatasetNotFoundError(IslandsError):
    """The owner has no such data set."""


class DatasetInUseError(IslandsError):
    """An unfinished job needs the data set."""


@dataclass(frozen=True, slots=True)
class StoredDataset:
    """An uploaded record.

    Attributes
    ----------
    id : str
        Derived from content, format and options of reading: the same bytes that are read in the same way are
        the same data set.
    name, suffix : str
        File name, and its suffix, which selects the reader.
    blob : str
        SHA-256 of the bytes.
    bytes : int
        Size of the file.
    preview : mapping
        Columns with units and statistics, sampling, warnings: see `islands.io.records.preview`. Jobs read the
        file with the options ``reading``.
    """

    owner: str
    id: str
    name: str
    suffix: str
    blob: str
    bytes: int
    preview: Mapping[str, Any]
    created: float


class Datasets:
    """Data set operations of the store.

    Parameters
    ----------
    database : Database
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def add(
        self,
        owner: str,
        name: str,
        suffix: str,
        blob: str,
        size: int,
        preview: Mapping[str, Any],
        most_bytes: int | None = None,
    ) -> tuple[StoredDataset, bool]:
        """Add a data set; return it, and whether it is new.

        Raises
        ------
        QuotaError
            The data sets of the owner would exceed ``most_bytes``.
        """
        identity = dataset_id(blob, suffix, preview.get("reading"))

        def operation(connection: Connection) -> tuple[StoredDataset, bool]:
            dialect.lock_owner(connection, owner)
            existing = connection.execute(_select(owner, identity)).one_or_none()
            if existing is not None:
                return _make_dataset(existing), False
            if most_bytes is not None:
                _check_quota(connection, owner, size, most_bytes)
            values = {
                "owner": owner,
                "id": identity,
                "name": name,
                "suffix": suffix,
                "blob": blob,
                "bytes": size,
                "preview": json.dumps(preview),
                "created": now(),
            }
            row = connection.execute(insert(datasets).values(values).returning(datasets)).one()
            return _make_dataset(row), True

        return self._database.write(operation)

    def check_room(
        self,
        owner: str,
        suffix: str,
        blob: str,
        size: int,
        most_bytes: int,
        reading: Mapping[str, Any] | None = None,
    ) -> None:
        """Raise the error that `add` would raise, before the bytes are stored.

        Raises
        ------
        QuotaError
        """
        with self._database.read() as connection:
            identity = dataset_id(blob, suffix, reading)
            if connection.execute(_select(owner, identity)).one_or_none() is None:
                _check_quota(connection, owner, size, most_bytes)

    def stored_bytes(self, owner: str) -> int:
        """Return the total size of the data sets of an owner."""
        with self._database.read() as connection:
            return _sum_bytes(connection, owner)

    def get(self, owner: str, dataset: str) -> StoredDataset:
        """Return a data set.

        Raises
        ------
        DatasetNotFoundError
        """
        with self._database.read() as connection:
            row = connection.execute(_select(owner, dataset)).one_or_none()
        if row is None:
            raise DatasetNotFoundError(
                f"there is no data set {dataset!r}: upload it first, or list the existing ones"
            )
        return _make_dataset(row)

    def page(
        self, owner: str, after: tuple[float, str] | None = None, limit: int = 50
    ) -> tuple[tuple[StoredDataset, ...], tuple[float, str] | None]:
        """Return a page of the data sets of an owner, newest first, and the position of the next page.

        The position is None on the last page.
        """
        query = select(datasets).where(datasets.c.owner == owner)
        if after is not None:
            query = query.where(tuple_(datasets.c.created, datasets.c.id) < tuple_(*after))
        query = query.order_by(datasets.c.created.desc(), datasets.c.id.desc()).limit(limit + 1)
        with self._database.read() as connection:
            found = [_make_dataset(row) for row in connection.execute(query)]
        more, found = len(found) > limit, found[:limit]
        return tuple(found), (found[-1].created, found[-1].id) if more else None

    def delete(self, owner: str, dataset: str) -> None:
        """Delete a data set that no unfinished job needs.

        Raises
        ------
        DatasetNotFoundError, DatasetInUseError
        """

        def operation(connection: Connection) -> None:
            if connection.execute(_select(owner, dataset)).one_or_none() is None:
                raise DatasetNotFoundError(f"there is no data set {dataset!r}")
            user = connection.execute(
                select(jobs.c.id)
                .where(jobs.c.owner == owner, jobs.c.state.in_(ACTIVE), jobs.c.spec.contains(f'"{dataset}"'))
                .limit(1)
            ).scalar()
            if user is not None:
                raise DatasetInUseError(f"job {user} needs data set {dataset!r}: wait for it, or cancel it")
            connection.execute(delete(datasets).where(datasets.c.owner == owner, datasets.c.id == dataset))

        self._database.write(operation)


def dataset_id(blob: str, suffix: str, reading: Mapping[str, Any] | None = None) -> str:
    """Return the id of a data set: the same bytes that are read in the same way have the same id."""
    if reading:
        blob = hashlib.sha256(f"{blob} {json.dumps(reading, sort_keys=True)}".encode()).hexdigest()
    return f"{blob[:32]}-{suffix.removeprefix('.')}"


def _sum_bytes(connection: Connection, owner: str) -> int:
    total = select(func.coalesce(func.sum(datasets.c.bytes), 0)).where(datasets.c.owner == owner)
    # PostgreSQL returns a decimal number for a sum of integers.
    return int(connection.execute(total).scalar_one())


def _check_quota(connection: Connection, owner: str, size: int, most: int) -> None:
    used = _sum_bytes(connection, owner)
    if used + size > most:
        raise QuotaError(
            f"the data sets take {used / 1e6:.1f} MB, this one has {size / 1e6:.1f} MB, and "
            f"{most / 1e6:.1f} MB is the most: delete some"
        )


def _select(owner: str, dataset: str) -> Any:
    return select(datasets).where(datasets.c.owner == owner, datasets.c.id == dataset)


def _make_dataset(row: Row[Any]) -> StoredDataset:
    return StoredDataset(
        row.owner, row.id, row.name, row.suffix, row.blob, row.bytes, json.loads(row.preview), row.created
    )
