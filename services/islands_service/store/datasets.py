"""Uploaded data sets and FMUs by owner. The bytes are blobs; the rows describe their content."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from sqlalchemy import Connection, Row, bindparam, func, insert, select, update

from islands.errors import IslandsError
from islands_service.domain.job import ACTIVE, QuotaError, Requester
from islands_service.domain.uploaded_fmu import FMU_SUFFIX
from islands_service.store import dialect
from islands_service.store.audit import Action, record_change
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.job_rows import delete_unused_datasets
from islands_service.store.tables import datasets, jobs, owners

#: Names of what is stored, by whether it is an FMU.
_KINDS = {False: "data set", True: "FMU"}


class DatasetNotFoundError(IslandsError):
    """The owner has no such data set."""


class FmuNotFoundError(IslandsError):
    """The owner has no such FMU."""


class DatasetInUseError(IslandsError):
    """An unfinished job needs the data set."""


@dataclass(frozen=True, slots=True)
class StoredDataset:
    """An uploaded record or FMU.

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
        Columns with units and statistics, sampling, warnings: see
        `islands.records.reading.preview`. Jobs read the file with the options ``reading``. In a page it
        contains only the fields of `summarise_preview`.
        That of an FMU has its description as ``fmu``, see `islands_service.domain.uploaded_fmu`.
    source : str or None
        URL of the download without its query; None for an upload.
    idle_since : float or None
        Time at which a sweep found that no job names the data set: see `Retention.expire_datasets`.
    """

    owner: str
    id: str
    name: str
    suffix: str
    blob: str
    bytes: int
    preview: Mapping[str, Any]
    created: float
    source: str | None = None
    idle_since: float | None = None


class Datasets(DatabaseOperations):
    """Data set operations of the store."""

    def add(
        self,
        owner: str,
        name: str,
        suffix: str,
        blob: str,
        size: int,
        preview: Mapping[str, Any],
        most_bytes: int | None = None,
        by: Requester | None = None,
        source: str | None = None,
        origin: str | None = None,
    ) -> tuple[StoredDataset, bool]:
        """Add a data set; return it, and whether it is new. One that was deleted is restored.

        Parameters
        ----------
        origin : str, optional
            Data set whose bytes it has. It must still exist, since the bytes of deleted ones are removed.

        Raises
        ------
        DatasetNotFoundError
            The origin has been deleted.
        QuotaError
            The data sets of the owner would exceed its quota, ``most_bytes`` unless another one is set.
        """
        identity = dataset_id(blob, suffix, preview.get("reading"))

        def operation(connection: Connection) -> tuple[StoredDataset, bool]:
            dialect.lock_owner(connection, owner)
            if origin is not None:
                _find_row(connection, owner, origin)
            existing = _read_row(connection, owner, identity)
            if existing is not None and existing.deleted is None:
                restart = update(datasets).where(datasets.c.owner == owner, datasets.c.id == identity)
                row = connection.execute(restart.values(idle_since=None).returning(datasets)).one()
                return _make_dataset(row), False
            details = None if source is None else json.dumps({"source": source})
            record_change(connection, Action.UPLOAD, owner, identity, by, details)
            if existing is not None:
                restore = (
                    update(datasets)
                    .where(datasets.c.owner == owner, datasets.c.id == identity)
                    .values(deleted=None, idle_since=None, name=name, created=now(), source=source)
                    .returning(datasets)
                )
                return _make_dataset(connection.execute(restore).one()), True
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
                "summary": json.dumps(summarise_preview(preview)),
                "created": now(),
                "source": source,
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
            # One that was deleted but is kept for a job counts already.
            if _read_row(connection, owner, identity) is None:
                _check_quota(connection, owner, size, most_bytes)

    def stored_bytes(self, owner: str) -> int:
        """Return the total size of the data sets of an owner."""
        with self._database.read() as connection:
            return sum(_sum_bytes(connection, owner))

    def get(
        self, owner: str, dataset: str, deleted: bool = False, is_fmu: bool | None = False
    ) -> StoredDataset:
        """Return a data set.

        Parameters
        ----------
        deleted : bool
            Whether to return also one that its owner has deleted but that a job still names.
        is_fmu : bool or None
            Whether it is an FMU; None for both.

        Raises
        ------
        DatasetNotFoundError, FmuNotFoundError
        """
        with self._database.read() as connection:
            return _make_dataset(_find_row(connection, owner, dataset, deleted, is_fmu))

    def page(
        self,
        owner: str,
        after: tuple[float, str] | None = None,
        limit: int = 50,
        is_fmu: bool = False,
    ) -> tuple[tuple[StoredDataset, ...], tuple[float, str] | None]:
        """Return a page of the data sets or FMUs of an owner, newest first, and the next position.

        The position is None on the last page. The previews are summaries.
        """
        query = _PAGE.where(datasets.c.owner == owner, datasets.c.deleted.is_(None))
        query = query.where((datasets.c.suffix == FMU_SUFFIX) == is_fmu)
        rows, position = self._read_page(query, datasets.c.created, datasets.c.id, after, limit)
        return tuple(_make_dataset(row, json.loads(row.summary)) for row in rows), position

    def delete(self, owner: str, dataset: str, by: Requester | None = None, is_fmu: bool = False) -> None:
        """Delete a data set or an FMU that no unfinished job needs.

        As long as a finished job names it, the row and the bytes are kept for its figures.

        Raises
        ------
        DatasetNotFoundError, FmuNotFoundError, DatasetInUseError
        """

        def operation(connection: Connection) -> None:
            dialect.lock_owner(connection, owner)
            _find_row(connection, owner, dataset, is_fmu=is_fmu)
            user = connection.execute(
                select(jobs.c.id)
                .where(jobs.c.owner == owner, jobs.c.state.in_(ACTIVE), jobs.c.spec.contains(f'"{dataset}"'))
                .limit(1)
            ).scalar()
            if user is not None:
                raise DatasetInUseError(
                    f"job {user} needs {_KINDS[is_fmu]} {dataset!r}: wait for it, or cancel it"
                )
            connection.execute(
                update(datasets)
                .where(datasets.c.owner == owner, datasets.c.id == dataset)
                .values(deleted=now())
            )
            delete_unused_datasets(connection, owner)
            record_change(connection, Action.DELETE_DATASET, owner, dataset, by)

        self._database.write(operation, urgent=True)


def dataset_id(blob: str, suffix: str, reading: Mapping[str, Any] | None = None) -> str:
    """Return the id of a data set: the same bytes that are read in the same way have the same id."""
    if reading:
        blob = hashlib.sha256(f"{blob} {json.dumps(reading, sort_keys=True)}".encode()).hexdigest()
    return f"{blob[:32]}-{suffix.removeprefix('.')}"


def summarise_preview(preview: Mapping[str, Any]) -> dict[str, Any]:
    """Return the part of a preview that a list contains: of the columns only their number."""
    return {
        "samples": preview.get("samples"),
        "columns": len(preview.get("columns", ())),
        "time": preview.get("time"),
        "dt": preview.get("dt"),
        "warnings": len(preview.get("warnings", ())),
        "reading": preview.get("reading", {}),
    }


def _sum_bytes(connection: Connection, owner: str) -> tuple[int, int]:
    """Return the total sizes of the listed data sets, and of the deleted ones that are kept for jobs."""
    query = (
        select(datasets.c.deleted.is_(None), func.sum(datasets.c.bytes))
        .where(datasets.c.owner == owner)
        .group_by(datasets.c.deleted.is_(None))
    )
    # PostgreSQL returns a decimal number for a sum of integers.
    sums = {bool(listed): int(total) for listed, total in connection.execute(query)}
    return sums.get(True, 0), sums.get(False, 0)


def _check_quota(connection: Connection, owner: str, size: int, most: int) -> None:
    listed, kept = _sum_bytes(connection, owner)
    used = listed + kept
    own = connection.execute(select(owners.c.max_stored).where(owners.c.name == owner)).scalar()
    most = most if own is None else own
    if used + size > most:
        advice = "delete some"
        if kept:
            advice += f" (results still need {kept / 1e6:.1f} MB of deleted ones: delete their jobs)"
        raise QuotaError(
            f"the data sets take {used / 1e6:.1f} MB, this one has {size / 1e6:.1f} MB, and "
            f"{most / 1e6:.1f} MB is the most: {advice}"
        )


# Built once, since building a statement takes as long as executing it.
_DATASET = select(datasets).where(datasets.c.owner == bindparam("owner"), datasets.c.id == bindparam("id"))


def _read_row(connection: Connection, owner: str, dataset: str) -> Row[Any] | None:
    return connection.execute(_DATASET, {"owner": owner, "id": dataset}).one_or_none()


def _find_row(
    connection: Connection, owner: str, dataset: str, deleted: bool = False, is_fmu: bool | None = False
) -> Row[Any]:
    row = _read_row(connection, owner, dataset)
    is_other = row is not None and is_fmu is not None and (row.suffix == FMU_SUFFIX) != is_fmu
    if row is None or is_other or (row.deleted is not None and not deleted):
        error = FmuNotFoundError if is_fmu else DatasetNotFoundError
        raise error(
            f"there is no {_KINDS[bool(is_fmu)]} {dataset!r}: upload it first, or list the existing ones"
        )
    return row


#: Rows for a page.
_PAGE = select(*(column for column in datasets.c if column.name not in ("preview", "deleted")))


def _make_dataset(row: Any, preview: Mapping[str, Any] | None = None) -> StoredDataset:
    if preview is None:
        preview = json.loads(row.preview)
    return StoredDataset(
        *(row.owner, row.id, row.name, row.suffix, row.blob, row.bytes, preview, row.created),
        *(row.source, row.idle_since),
    )
