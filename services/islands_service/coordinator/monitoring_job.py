"""Monitoring job: analyse a record of a monitor; the outcome contains the new state of the monitor."""

import json
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from islands.effects.interface.context import Signal
from islands.errors import RecordError
from islands.facade.record_monitor import create_monitor, monitor_record
from islands.records.dataset import Dataset
from islands.report.documents.monitor_json import (
    describe_alarm,
    describe_alarm_text,
    describe_last_record,
    describe_monitor,
    describe_record,
    describe_status,
)
from islands.report.documents.monitor_state import (
    RejectedRecord,
    SavedMonitor,
    head_to_json,
    monitor_from_head,
    record_to_json,
)
from islands_service.coordinator.job_failures import check_readable, make_problem_document
from islands_service.coordinator.job_run import JobRun
from islands_service.domain.job import JobOutcome, JobState, ProgressReport
from islands_service.domain.monitor_spec import MonitorSpec, name_record, parse_monitor, parse_monitor_record
from islands_service.domain.monitoring import (
    Monitor,
    MonitorStates,
    MonitorStatus,
    MonitorUpdate,
    RecordEntry,
)
from islands_service.intake.job_inputs import read_record_and_columns

#: Schema of the result of a record.
SCHEMA = "islands.monitored-record/1"


def run_monitoring_job(run: JobRun) -> JobOutcome:
    """Analyse a record and add it to the state of its monitor.

    This function writes nothing: a job that is interrupted starts again with the same state of the monitor.
    A record that cannot be used fails its job, and is listed in the monitor.

    Raises
    ------
    MonitorNotFoundError
        The monitor was deleted.
    IslandsError
        The monitor or the first record is unusable, or any error that ``run.check`` raises.
    """
    identity, asked = parse_monitor_record(run.job.spec)
    monitors = run.store.monitors
    monitor, states = monitors.load(run.job.owner, identity)
    saved = _parse_states(monitor, states)
    stored = run.get_dataset(asked.dataset)
    run.store.leases.report(run.lease, ProgressReport({"phase": "analysis of the record"}))
    spec, name = parse_monitor(monitor.spec), name_record(asked, stored.name)
    reading = spec.describe_record(asked.dataset, asked.rows)
    sha256 = stored.blob
    try:
        record, columns = read_record_and_columns(reading, {asked.dataset: stored}, run.blobs)
        run.check()
        sha256 = record.sha256
        if states is not None and (
            known := monitors.find_record(monitor.id, name, sha256, is_rejected=False)
        ):
            return _describe_known(monitor, states, name, json.loads(known))
        before = saved or _create_monitor(spec, record, columns)
        after = monitor_record(before, record, name, asked.time or "", columns)
    except RecordError as error:
        update = None
        # A monitor without records has no parameters yet, and lists no record.
        if (
            saved is not None
            and states is not None
            and monitors.find_record(monitor.id, name, sha256, is_rejected=True) is None
        ):
            update = _make_rejection(monitor, saved, states, RejectedRecord(name, sha256, str(error)))
        return JobOutcome(JobState.FAILED, problem=make_problem_document(error), monitor=update)
    run.check()
    return _describe_outcome(monitor, states, before, after)


def _parse_states(monitor: Monitor, states: MonitorStates | None) -> SavedMonitor | None:
    """Return the monitor with the records that the next one is compared with; None before the first one.

    Raises
    ------
    JobDeclinedError
        A newer version of islands wrote the states, and this one cannot read them.
    """
    if states is None:
        return None
    try:
        return monitor_from_head(states.head, states.start, states.records, f"monitor {monitor.id}")
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


def _describe_known(
    monitor: Monitor, states: MonitorStates, name: str, document: dict[str, Any]
) -> JobOutcome:
    """Return the outcome of a record that was submitted and analysed before: the monitor does not change."""
    alarms = [
        each for each in json.loads(states.document)["alarms"] if each["record"]["index"] == document["index"]
    ]
    return JobOutcome(
        JobState.SUCCEEDED,
        _make_result(monitor, monitor.status, document, alarms),
        summary={
            "monitor": monitor.id,
            "status": monitor.status,
            "alarms": 0,
            "words": f"{name} was analysed before",
        },
    )


def _describe_outcome(
    monitor: Monitor, states: MonitorStates | None, before: SavedMonitor, after: SavedMonitor
) -> JobOutcome:
    state = after.state
    raised = state.alarms[len(before.state.alarms) :]
    alarms = [describe_alarm(state, alarm) for alarm in raised]
    record = state.records[-1]
    document = {"index": state.count - 1, **describe_record(state, record)}
    entry = RecordEntry(record.name, record.sha256, False, record_to_json(record), _dump(document))
    update = _make_update(monitor, after, [*_get_alarms(states), *alarms], entry)
    if alarms:
        update = replace(update, alarm=_dump(alarms[-1]))
    words = "\n".join([describe_last_record(state), *(describe_alarm_text(state, alarm) for alarm in raised)])
    return JobOutcome(
        JobState.SUCCEEDED,
        _make_result(monitor, update.status, document, alarms),
        summary={"monitor": monitor.id, "status": update.status, "alarms": len(raised), "words": words},
        monitor=update,
    )


def _make_rejection(
    monitor: Monitor, saved: SavedMonitor, states: MonitorStates, rejected: RejectedRecord
) -> MonitorUpdate:
    """Return the update of a monitor by a record that cannot be used."""
    state = asdict(rejected)
    document = {"index": monitor.version - monitor.records, **state}
    entry = RecordEntry(rejected.name, rejected.sha256, True, _dump(state), _dump(document))
    return _make_update(monitor, saved, _get_alarms(states), entry)


def _get_alarms(states: MonitorStates | None) -> list[dict[str, Any]]:
    """Return the earlier alarms for clients; the records that they name may not have been loaded."""
    return [] if states is None else list(json.loads(states.document)["alarms"])


def _make_update(
    monitor: Monitor, after: SavedMonitor, alarms: list[dict[str, Any]], entry: RecordEntry
) -> MonitorUpdate:
    state = after.state
    return MonitorUpdate(
        monitor.id,
        monitor.version,
        MonitorStatus(describe_status(state)),
        state.count,
        len(state.alarms),
        state.start,
        head_to_json(after),
        _dump(describe_monitor(after, alarms)),
        entry,
    )


def _dump(document: dict[str, Any]) -> str:
    return json.dumps(document, allow_nan=False)


def _make_result(
    monitor: Monitor, status: MonitorStatus, record: dict[str, Any], alarms: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return the result of a record: its states, and the alarms that it raised."""
    return {"schema": SCHEMA, "monitor": monitor.id, "status": status, "record": record, "alarms": alarms}
