"""Updates of monitors without an analysis."""

import json
from collections.abc import Sequence
from dataclasses import asdict

from sqlalchemy import Connection

from islands.report.documents.monitor_json import (
    describe_alarm,
    describe_monitor,
    describe_record,
    describe_status,
)
from islands.report.documents.monitor_state import SavedMonitor, head_to_json, record_to_json
from islands_service.domain.monitoring import Monitor, MonitorStatus, MonitorUpdate, RecordEntry
from islands_service.store import Store
from islands_service.store.monitors import update_monitor


def make_entry(record: int, index: int, is_rejected: bool = False) -> RecordEntry:
    document = json.dumps({"index": index, "name": f"record {record}", "sha256": f"{record:064x}"})
    return RecordEntry(f"record {record}", f"{record:064x}", is_rejected, json.dumps(record), document)


def make_update(
    monitor: Monitor, records: Sequence[int], is_alarm: bool = False, start: int = 0
) -> MonitorUpdate:
    """Return the update of a monitor by the last one of its records, which are numbers."""
    alarm = {"record": {"index": len(records) - 1}, "words": "k changed"}
    return MonitorUpdate(
        monitor.id,
        monitor.version,
        MonitorStatus.ALARM if is_alarm else MonitorStatus.NORMAL,
        len(records),
        monitor.alarms + is_alarm,
        start,
        json.dumps({"schema": "islands.monitor-head/1", "state": {"records": []}, "rejected": []}),
        json.dumps({"count": len(records)}),
        make_entry(records[-1], len(records) - 1),
        json.dumps(alarm) if is_alarm else None,
    )


def store_monitor(store: Store, monitor: str, saved: SavedMonitor) -> None:
    """Store the records of a monitor without jobs, as if they had been analysed one after the other."""
    state = saved.state
    document = json.dumps(describe_monitor(saved, [describe_alarm(state, each) for each in state.alarms]))
    entries = [
        RecordEntry(
            each.name,
            each.sha256,
            False,
            record_to_json(each),
            json.dumps({"index": at, **describe_record(state, each)}),
        )
        for at, each in enumerate(state.records)
    ]
    for at, fields in enumerate(map(asdict, saved.rejected)):
        texts = json.dumps(fields), json.dumps({"index": at, **fields})
        entries.append(RecordEntry(fields["name"], fields["sha256"], True, *texts))
    alarm = json.dumps(describe_alarm(state, state.alarms[-1])) if state.alarms else None
    status = MonitorStatus(describe_status(state))

    def write(connection: Connection) -> None:
        for version, entry in enumerate(entries):
            count = min(version + 1, len(state.records))
            head = head_to_json(saved)
            change = MonitorUpdate(
                monitor, version, status, count, len(state.alarms), state.start, head, document, entry, alarm
            )
            update_monitor(connection, "", change)

    store.database.write(write)
