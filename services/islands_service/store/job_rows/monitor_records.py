"""Records of monitors in the transactions of their jobs: number, order of claims, effect on the monitor."""

from sqlalchemy import Connection, and_, exists, insert, or_, select, update

from islands_service.domain.job import ISLANDS_VERSION, JobState, LeaseLostError
from islands_service.domain.monitoring import MonitorNotFoundError, MonitorUpdate
from islands_service.domain.webhook import ALARM_EVENT, make_alarm_body
from islands_service.store.backends.dialect import now
from islands_service.store.tables import jobs, monitor_records, monitors
from islands_service.store.tenants.deliveries import queue_event

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
