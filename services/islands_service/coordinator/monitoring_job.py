"""Monitoring job: analyse a record of a monitor; the outcome contains the new state of the monitor."""

import json
from collections.abc import Callable, Mapping
from typing import Any

from islands.data.dataset import Dataset
from islands.discrepancy.interfaces.context import Signal
from islands.errors import RecordError
from islands.evolution.engine import Engine
from islands.facade.record_monitor import create_monitor, monitor_record, reject_record
from islands.io.checkpoints.monitor_document import (
    describe_alarm,
    describe_record,
    describe_status,
    monitor_document,
)
from islands.io.checkpoints.monitor_state import SavedMonitor, monitor_from_json, monitor_to_json
from islands.io.result_text.monitor_text import describe_alarm_text, describe_last_record
from islands_service.coordinator.job_failures import check_readable, make_problem_document
from islands_service.coordinator.job_notes import JobNotes
from islands_service.domain.job import JobOutcome, JobState, Lease, ProgressReport
from islands_service.domain.monitor_spec import MonitorSpec, name_record, parse_monitor, parse_monitor_record
from islands_service.domain.monitoring import Monitor, MonitorStatus, MonitorUpdate
from islands_service.intake.job_inputs import read_record_and_columns
from islands_service.store import Store
from islands_service.store.blobs import Blobs

#: Schema of the result of a record.
SCHEMA = "islands.monitored-record/1"


def run_monitoring_job(
    lease: Lease,
    store: Store,
    blobs: Blobs,
    _engine: Engine,
    check: Callable[[], None],
    _every: float,
    _notes: JobNotes | None = None,
) -> JobOutcome:
    """Analyse a record and add it to the state of its monitor.

    This function writes nothing: a job that is interrupted starts again with the same state of the monitor.
    A record that cannot be used fails its job, and is listed in the monitor.

    Parameters
    ----------
    check : callable
        Raises the reason if the job must end early.

    Raises
    ------
    MonitorNotFoundError
        The monitor was deleted.
    IslandsError
        The monitor or the first record is unusable, or any error that ``check`` raises.
    """
    identity, asked = parse_monitor_record(lease.job.spec)
    monitor, state = store.monitors.load(lease.job.owner, identity)
    saved = _parse_state(monitor, state)
    stored = store.datasets.get(lease.job.owner, asked.dataset, deleted=True)
    store.leases.report(lease, ProgressReport({"phase": "analysis of the record"}))
    spec, name = parse_monitor(monitor.spec), name_record(asked, stored.name)
    reading = spec.describe_record(asked.dataset, asked.rows)
    sha256 = stored.blob
    try:
        record, columns = read_record_and_columns(reading, {asked.dataset: stored}, blobs)
        check()
        sha256 = record.sha256
        if saved is not None and (known := _find_record(saved, name, sha256)) is not None:
            return _describe_known(monitor, saved, known)
        before = saved or _create_monitor(spec, record, columns)
        after = monitor_record(before, record, name, asked.time or "", columns)
    except RecordError as error:
        return _reject(monitor, saved, name, sha256, error)
    check()
    return _describe_outcome(monitor, before, after)


def _parse_state(monitor: Monitor, state: str | None) -> SavedMonitor | None:
    """Return the state of a monitor; None before its first record.

    Raises
    ------
    JobDeclinedError
        A newer version of islands wrote the state, and this one cannot read it.
    """
    if state is None:
        return None
    try:
        return monitor_from_json(state, f"monitor {monitor.id}")
    except Exception as error:
        check_readable(monitor.written_by, "monitor", error)
        raise


def _create_monitor(spec: MonitorSpec, record: Dataset, columns: Mapping[str, Signal]) -> SavedMonitor:
    return create_monitor(
        record,
        # As a document: an extended simulation has another type over REST than in the library.
        spec.simulation.model_dump(mode="json", exclude_unset=True, by_alias=True),
        false_alarms=spec.false_alarms,
        interval=spec.interval,
        training=spec.training,
        tolerance=spec.tolerance,
        columns=columns,
    )


def _find_record(saved: SavedMonitor, name: str, sha256: str) -> int | None:
    """Return the index of an analysed record of the same name and content."""
    for index, record in enumerate(saved.state.records):
        if (record.name, record.sha256) == (name, sha256):
            return index
    return None


def _describe_known(monitor: Monitor, saved: SavedMonitor, index: int) -> JobOutcome:
    """Return the outcome of a record that was submitted and analysed before: the monitor does not change."""
    words = f"{saved.state.records[index].name} was analysed before"
    return JobOutcome(
        JobState.SUCCEEDED,
        _make_document(monitor, saved, index),
        summary={"monitor": monitor.id, "status": monitor.status, "alarms": 0, "words": words},
    )


def _describe_outcome(monitor: Monitor, before: SavedMonitor, after: SavedMonitor) -> JobOutcome:
    raised = after.state.alarms[len(before.state.alarms) :]
    update = _make_update(monitor, after, bool(raised))
    alarms = [describe_alarm_text(after.state, each) for each in raised]
    words = "\n".join([describe_last_record(after.state), *alarms])
    return JobOutcome(
        JobState.SUCCEEDED,
        _make_document(monitor, after, len(after.state.records) - 1),
        summary={"monitor": monitor.id, "status": update.status, "alarms": len(raised), "words": words},
        monitor=update,
    )


def _reject(
    monitor: Monitor, saved: SavedMonitor | None, name: str, sha256: str, error: RecordError
) -> JobOutcome:
    """Return the outcome of a record that cannot be used; a monitor without records cannot list it."""
    problem = make_problem_document(error)
    update = None
    if saved is not None and not any((name, sha256) == (each.name, each.sha256) for each in saved.rejected):
        update = _make_update(monitor, reject_record(saved, name, sha256, str(error)), False)
    return JobOutcome(JobState.FAILED, problem=problem, monitor=update)


def _make_update(monitor: Monitor, after: SavedMonitor, is_alarm: bool) -> MonitorUpdate:
    return MonitorUpdate(
        monitor.id,
        monitor.version,
        MonitorStatus(describe_status(after.state)),
        len(after.state.records),
        len(after.state.alarms),
        monitor_to_json(after),
        json.dumps(monitor_document(after), allow_nan=False),
        is_alarm,
    )


def _make_document(monitor: Monitor, saved: SavedMonitor, index: int) -> dict[str, Any]:
    """Return the result of a record: its states, and the alarms that it raised."""
    state = saved.state
    return {
        "schema": SCHEMA,
        "monitor": monitor.id,
        "status": describe_status(state),
        "record": describe_record(state, state.records[index]),
        "alarms": [describe_alarm(state, each) for each in state.alarms if each.record == index],
    }
