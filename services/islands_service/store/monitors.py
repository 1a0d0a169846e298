"""Monitors of owners: create, read, list, delete. Their records are jobs, and change them when they end."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

from sqlalchemy import (
    Column,
    Connection,
    Row,
    Select,
    and_,
    delete,
    exists,
    func,
    insert,
    or_,
    select,
    update,
)

from islands_service.domain.job import (
    ACTIVE,
    ISLANDS_VERSION,
    JobState,
    LeaseLostError,
    QuotaError,
    Requester,
)
from islands_service.domain.monitoring import (
    Monitor,
    MonitorNotFoundError,
    MonitorStates,
    MonitorStatus,
    MonitorUpdate,
)
from islands_service.domain.webhook import ALARM_EVENT, make_alarm_body
from islands_service.store import dialect
from islands_service.store.audit import Action, record_change
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.job_rows import cancel_job
from islands_service.store.tables import jobs, monitor_records, monitors
from islands_service.store.webhooks import queue_event

_PENDING = (
    select(func.count())
    .select_from(jobs)
    .where(jobs.c.monitor_id == monitors.c.id, jobs.c.state.in_(ACTIVE))
    .scalar_subquery()
)

#: Rows without the states.
_ROWS: Select[Any] = select(
    *(column for column in monitors.c if column.name not in ("state", "document")), _PENDING.label("pending")
)

#: Schema of a state with its records: that of `islands.report.documents.monitor_state`, which this module
#: does not import for its numerical packages. A test compares them.
STATE_SCHEMA = "islands.monitor-state/1"

_other = jobs.alias("other")

#: True for a job of no monitor, and for the next record of a monitor: no other one is being analysed, and
#: none of those that were submitted before is queued. The number orders them, not the time of the submission,
#: which two records may have in common and which a clock that goes back turns round.
IS_NEXT_RECORD = ~exists(
    select(_other.c.id)
    .where(
        _other.c.monitor_id == jobs.c.monitor_id,
        or_(
            _other.c.state == JobState.RUNNING,
            and_(_other.c.state == JobState.QUEUED, _other.c.record_number < jobs.c.record_number),
        ),
    )
    .correlate(jobs)
)


@dataclass(frozen=True, slots=True)
class MonitorStatistics:
    """Number of the monitors of all owners by status, and of their alarms."""

    counts: Mapping[MonitorStatus, int]
    alarms: int


class Monitors(DatabaseOperations):
    """Monitor operations of the store."""

    def create(
        self,
        owner: str,
        name: str,
        spec: Mapping[str, Any],
        priority: int,
        most: int,
        by: Requester | None = None,
    ) -> Monitor:
        """Create a monitor without records.

        Parameters
        ----------
        spec : mapping
            A specification that was checked by the caller.
        most : int
            Largest number of monitors of an owner.

        Raises
        ------
        QuotaError
            The owner has ``most`` monitors.
        """
        identity = uuid4().hex
        values = {
            "id": identity,
            "owner": owner,
            "name": name,
            "spec": json.dumps(spec),
            "priority": priority,
            "status": MonitorStatus.WAITING,
            **dict.fromkeys(("version", "submitted", "records", "alarms"), 0),
        }

        def operation(connection: Connection) -> Monitor:
            dialect.lock_owner(connection, owner)
            present = connection.execute(
                select(func.count()).select_from(monitors).where(monitors.c.owner == owner)
            ).scalar_one()
            if present >= most:
                raise QuotaError(f"{present} monitors exist, and {most} is the most: delete one first")
            connection.execute(insert(monitors).values(**values, created=now(), updated=now()))
            record_change(connection, Action.CREATE_MONITOR, owner, identity, by)
            return _make_monitor(_read_owned(connection, owner, identity))

        return self._database.write(operation)

    def get(self, owner: str, monitor: str) -> Monitor:
        """Return a monitor.

        Raises
        ------
        MonitorNotFoundError
        """
        with self._database.read() as connection:
            return _make_monitor(_read_owned(connection, owner, monitor))

    def load(self, owner: str, monitor: str) -> tuple[Monitor, MonitorStates | None]:
        """Return a monitor and its states for the next record; None before the first one.

        Raises
        ------
        MonitorNotFoundError
        """
        with self._database.read() as connection:
            query = _ROWS.add_columns(monitors.c.state, monitors.c.document)
            row = _read_owned(connection, owner, monitor, query)
            if row.state is None:
                return _make_monitor(row), None
            records = _read_records(connection, monitor_records.c.state, monitor, False, row.start)
        return _make_monitor(row), MonitorStates(row.state, row.document, row.start, tuple(records))

    def result(self, owner: str, monitor: str) -> tuple[Monitor, str | None]:
        """Return a monitor and its document for clients; None before the first record.

        Raises
        ------
        MonitorNotFoundError
        """
        with self._database.read() as connection:
            row = _read_owned(connection, owner, monitor, _ROWS.add_columns(monitors.c.document))
        return _make_monitor(row), row.document

    def saved(self, owner: str, monitor: str) -> str | None:
        """Return the state with all records, as a file of the command line; None before the first record.

        Raises
        ------
        MonitorNotFoundError
        """
        with self._database.read() as connection:
            row = _read_owned(connection, owner, monitor, _ROWS.add_columns(monitors.c.state))
            # Records that were added after the row was read do not belong to its state.
            analysed, rejected = (
                _read_records(connection, monitor_records.c.state, monitor, is_rejected, limit=count)
                for is_rejected, count in ((False, row.records), (True, row.version - row.records))
            )
        if row.state is None:
            return None
        document = json.loads(row.state)
        document["schema"] = STATE_SCHEMA
        document["state"]["records"] = [json.loads(record) for record in analysed]
        document["rejected"] = [json.loads(record) for record in rejected]
        return json.dumps(document, allow_nan=False) + "\n"

    def records(
        self, owner: str, monitor: str, is_rejected: bool, after: int = -1, limit: int | None = None
    ) -> list[str]:
        """Return the documents of analysed or rejected records after a number, in the order of their numbers.

        Raises
        ------
        MonitorNotFoundError
        """
        column = monitor_records.c.document
        with self._database.read() as connection:
            _read_owned(connection, owner, monitor)
            return _read_records(connection, column, monitor, is_rejected, after + 1, limit)

    def find_record(self, monitor: str, name: str, sha256: str, is_rejected: bool) -> str | None:
        """Return the document of the first record of a name and a content; None if there is none."""
        rows = monitor_records.c
        query = (
            select(rows.document)
            .where(rows.monitor_id == monitor, rows.is_rejected.is_(is_rejected))
            .where(rows.sha256 == sha256, rows.name == name)
            .order_by(rows.place)
            .limit(1)
        )
        with self._database.read() as connection:
            return connection.execute(query).scalar()

    def page(
        self, owner: str, after: tuple[float, str] | None = None, limit: int = 50
    ) -> tuple[tuple[Monitor, ...], tuple[float, str] | None]:
        """Return a page of the monitors of an owner, newest first, and the position of the next page."""
        query = _ROWS.where(monitors.c.owner == owner)
        rows, position = self._read_page(query, monitors.c.created, monitors.c.id, after, limit)
        return tuple(map(_make_monitor, rows)), position

    def delete(self, owner: str, monitor: str, by: Requester | None = None) -> None:
        """Delete a monitor with its states, and cancel the jobs of its records. Finished jobs are kept.

        Raises
        ------
        MonitorNotFoundError
        """

        def operation(connection: Connection) -> None:
            # First, since it locks the row: a record that is being submitted then finds no monitor.
            gone = delete(monitors).where(*_owned(owner, monitor)).returning(monitors.c.id)
            if connection.execute(gone).one_or_none() is None:
                raise _make_not_found_error(monitor)
            unfinished = select(jobs).where(
                jobs.c.monitor_id == monitor, jobs.c.state.in_(ACTIVE), jobs.c.cancel_requested.is_(False)
            )
            for job in connection.execute(unfinished.with_for_update()).all():
                cancel_job(connection, job)
            record_change(connection, Action.DELETE_MONITOR, owner, monitor, by)

        self._database.write(operation, urgent=True)

    def statistics(self) -> MonitorStatistics:
        """Return statistics of the monitors of all owners."""
        query = select(monitors.c.status, func.count(), func.sum(monitors.c.alarms)).group_by(
            monitors.c.status
        )
        with self._database.read() as connection:
            found = connection.execute(query).all()
        counts = {row[0]: row[1] for row in found}
        # PostgreSQL returns a decimal number for a sum of integers.
        alarms = sum(int(row[2]) for row in found)
        return MonitorStatistics({status: counts.get(status, 0) for status in MonitorStatus}, alarms)


def _owned(owner: str, monitor: str) -> tuple[Any, ...]:
    return monitors.c.id == monitor, monitors.c.owner == owner


def _read_records(
    connection: Connection,
    column: Column[Any],
    monitor: str,
    is_rejected: bool,
    first: int = 0,
    limit: int | None = None,
) -> list[str]:
    """Read a text of the analysed or rejected records of a monitor, in order."""
    rows = monitor_records.c
    chosen = (rows.monitor_id == monitor, rows.is_rejected.is_(is_rejected), rows.place >= first)
    return list(connection.execute(select(column).where(*chosen).order_by(rows.place).limit(limit)).scalars())


def _read_owned(connection: Connection, owner: str, monitor: str, query: Select[Any] = _ROWS) -> Row[Any]:
    row = connection.execute(query.where(*_owned(owner, monitor))).one_or_none()
    if row is None:
        raise _make_not_found_error(monitor)
    return row


def _make_not_found_error(monitor: str) -> MonitorNotFoundError:
    return MonitorNotFoundError(f"there is no monitor {monitor!r}: list them with GET /v1/monitors")


def _make_monitor(row: Row[Any]) -> Monitor:
    return Monitor(
        row.id,
        row.owner,
        row.name,
        json.loads(row.spec),
        row.priority,
        row.version,
        MonitorStatus(row.status),
        row.records,
        row.alarms,
        row.pending,
        row.created,
        row.updated,
        row.islands_version,
        None if row.last_alarm is None else json.loads(row.last_alarm),
    )


def count_record(connection: Connection, owner: str, monitor: str) -> int:
    """Count one more submitted record of a monitor; return its number.

    Raises
    ------
    MonitorNotFoundError
        The monitor does not exist, or was deleted meanwhile.
    """
    counted = (
        update(monitors)
        .where(monitors.c.id == monitor, monitors.c.owner == owner)
        .values(submitted=monitors.c.submitted + 1)
        .returning(monitors.c.submitted)
    )
    number: int | None = connection.execute(counted).scalar()
    if number is None:
        raise MonitorNotFoundError(f"there is no monitor {monitor!r}: list them with GET /v1/monitors")
    return number


def update_monitor(connection: Connection, job: str, change: MonitorUpdate) -> None:
    """Store a record and the state of its monitor after it, and queue the event of an alarm.

    Raises
    ------
    LeaseLostError
        The monitor was deleted, or has another version than the one to which the record was added.
    """
    row = connection.execute(
        update(monitors)
        .where(monitors.c.id == change.monitor, monitors.c.version == change.version)
        .values(
            version=change.version + 1,
            status=change.status,
            records=change.records,
            alarms=change.alarms,
            start=change.start,
            state=change.head,
            document=change.document,
            **({} if change.alarm is None else {"last_alarm": change.alarm}),
            updated=now(),
            islands_version=ISLANDS_VERSION,
        )
        .returning(monitors.c.id, monitors.c.owner, monitors.c.name, monitors.c.updated)
    ).one_or_none()
    if row is None:
        raise LeaseLostError(f"the monitor {change.monitor} of job {job} was changed or deleted")
    entry = change.entry
    # The version counts the analysed and the rejected records before this one.
    place = change.version - change.records if entry.is_rejected else change.records - 1
    connection.execute(
        insert(monitor_records).values(
            monitor_id=change.monitor,
            is_rejected=entry.is_rejected,
            place=place,
            name=entry.name,
            sha256=entry.sha256,
            state=entry.state,
            document=entry.document,
        )
    )
    if change.alarm is not None:
        body = make_alarm_body(row.id, row.name, job, row.updated)
        queue_event(connection, ALARM_EVENT, row.owner, job, body, row.updated)
