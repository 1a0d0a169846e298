"""Result of a monitor: the JSON document ``monitor.json``, and lines of text about records and alarms."""

import json
from typing import Any

from islands.diagnosis.monitoring.change_point import ChangeForm
from islands.diagnosis.monitoring.record_follower import Alarm, MonitoredRecord, MonitorState
from islands.report.documents.monitor_state import SavedMonitor
from islands.rounding import NORMAL_95
from islands.sentences import write_one

SCHEMA = "islands.monitor/1"


def monitor_document(monitor: SavedMonitor) -> dict[str, Any]:
    """Return the states and alarms of a monitor as a JSON document."""
    state = monitor.state
    return {
        **describe_monitor(monitor, [describe_alarm(state, each) for each in state.alarms]),
        "records": [describe_record(state, each) for each in state.records],
        "rejected": [
            {"name": each.name, "sha256": each.sha256, "reason": each.reason} for each in monitor.rejected
        ],
    }


def describe_monitor(monitor: SavedMonitor, alarms: list[dict[str, Any]]) -> dict[str, Any]:
    """Return the document of a monitor without its records."""
    state = monitor.state
    reference = state.reference
    return {
        "schema": SCHEMA,
        "status": describe_status(state),
        "false_alarms": {"given": monitor.false_alarms, "per_record": state.settings.false_alarms},
        "interval_s": monitor.interval,
        "training": state.settings.training,
        "threshold": None if reference is None else state.threshold,
        "parameters": [
            {"name": each.name, "unit": each.unit, "nominal": each.nominal}
            for each in (() if reference is None else reference.parameters)
        ],
        "effects": [each.effect for each in (() if reference is None else reference.directions)],
        "alarms": alarms,
    }


def monitor_json(monitor: SavedMonitor) -> str:
    """Return the text of ``monitor.json``."""
    return json.dumps(monitor_document(monitor), indent=2, allow_nan=False) + "\n"


def describe_status(state: MonitorState) -> str:
    """Return ``training``, ``alarm`` if the last record raised one, or ``normal``."""
    if state.alarms and state.alarms[-1].record == state.count - 1:
        return "alarm"
    return "training" if state.is_training else "normal"


def describe_record(state: MonitorState, record: MonitoredRecord) -> dict[str, Any]:
    """Return the states of the effects in one record, with 95 % intervals."""
    assert state.reference is not None
    states = record.states
    parameters = zip(state.reference.parameters, states.values, states.errors, strict=True)
    scores = zip(state.reference.directions, states.scores, strict=True)
    return {
        "name": record.name,
        "time": record.time or None,
        "sha256": record.sha256,
        "values": {
            each.name: {"value": value, "ci95": [value - NORMAL_95 * error, value + NORMAL_95 * error]}
            for each, value, error in parameters
        },
        "scores": {each.effect: score for each, score in scores},
        "noise": states.noise,
        "rmse": states.rmse,
        "statistic": record.statistic,
    }


def describe_alarm(state: MonitorState, alarm: Alarm) -> dict[str, Any]:
    """Return an alarm with the names and times of its records, and in words."""

    def place(index: int) -> dict[str, Any]:
        record = state.get_record(index)
        return {"index": index, "name": record.name, "time": record.time or None}

    return {
        "record": place(alarm.record),
        "kind": str(alarm.kind),
        "words": describe_change(state, alarm),
        "cause": alarm.cause or None,
        "since": place(alarm.since),
        "since_ci95": [place(alarm.earliest), place(alarm.latest)],
        "form": str(alarm.form),
        "statistic": alarm.statistic,
        "before": alarm.before,
        "after": alarm.after,
        "equivalents": list(alarm.equivalents),
        "strength": {name: {"value": value, "unit": unit} for name, value, unit in alarm.strength},
    }


def describe_last_record(state: MonitorState) -> str:
    """Return one line on the last record: its parameters with their intervals, and the largest statistic."""
    record, reference = state.records[-1], state.reference
    assert reference is not None
    estimates = zip(reference.parameters, record.states.values, record.states.errors, strict=True)
    return write_one(
        "monitor",
        "last_record",
        record=record,
        values=[(each.name, value, NORMAL_95 * error, each.unit) for each, value, error in estimates],
        threshold=state.threshold,
        seen=state.count - state.start,
        training=state.settings.training,
    )


def describe_alarm_text(state: MonitorState, alarm: Alarm) -> str:
    """Return one line on an alarm, as `describe_change`."""
    return _write(state, alarm, "alarm")


def describe_change(state: MonitorState, alarm: Alarm) -> str:
    """Return an alarm in words: cause, since when, size, and causes that explain it as well."""
    return _write(state, alarm, "change")


def _write(state: MonitorState, alarm: Alarm, statement: str) -> str:
    assert state.reference is not None
    units = {each.name: each.unit for each in state.reference.parameters}
    indices = {"since": alarm.since, "earliest": alarm.earliest, "latest": alarm.latest}
    return write_one(
        "monitor",
        statement,
        alarm=alarm,
        kind=alarm.kind.name,
        is_ramp=alarm.form == ChangeForm.RAMP,
        is_growing=alarm.after > alarm.before,
        unit=units.get(alarm.cause, ""),
        **{name: state.get_record(index).name for name, index in indices.items()},
    )
