"""`create_monitor` and `monitor_record`: follow a diagnosed simulation from record to record."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeAlias

import numpy as np
from pydantic import TypeAdapter, ValidationError

from islands.diagnosis.monitoring.alarm_rate import parse_alarm_rate
from islands.diagnosis.monitoring.record_follower import MonitorSettings, MonitorState, follow_record
from islands.diagnosis.settings import MonitoringSettings
from islands.effects.interface.context import Signal
from islands.errors import RecordError, SettingsError
from islands.records.compatibility import ColumnReference, match_record
from islands.records.dataset import Dataset
from islands.report.documents.monitor_state import RejectedRecord, SavedMonitor
from islands.settings_schema import document_settings
from islands.simulators.interface import Simulator
from islands.simulators.specification.description import describe_extension
from islands.simulators.specification.factory import make_simulator
from islands.simulators.specification.table import (
    ExtendedSpec,
    LocalSpec,
    SimulationSpec,
    find_extended_file,
    is_extended,
    parse_spec,
)

_LOCAL_SPEC: TypeAdapter[LocalSpec] = TypeAdapter(LocalSpec)

#: Simulation as a user names it, quoted in signatures.
MonitoredLike: TypeAlias = str | SimulationSpec | LocalSpec | Mapping[str, Any]


@document_settings(MonitoringSettings, "settings")
def create_monitor(
    record: Dataset,
    simulation: "MonitoredLike",
    *,
    columns: Mapping[str, Signal] | None = None,
    **settings: Any,
) -> SavedMonitor:
    """Create a monitor of a simulation. `monitor_record` analyses the records, the first one included.

    Parameters
    ----------
    record : Dataset
        The first record. A simulation whose parameters are estimated from a record gets those of this one.
    simulation : str, spec or mapping
        ``extended.json`` of a diagnosis or its folder, text as on the command line, a specification, or the
        document of an extended simulation.
    columns : mapping, optional
        Outputs of external simulations by name, each of shape (samples,).
    **settings

    Raises
    ------
    SettingsError, ModelError
        There is no such simulation, or a setting is invalid.
    RecordError
        The record cannot be used.
    """
    given = MonitoringSettings(**settings)
    interval = given.interval or record.samples * record.dt
    rate = parse_alarm_rate(given.false_alarms, interval)
    state = MonitorState(MonitorSettings(rate, given.training, given.tolerance))
    spec = parse_monitored(simulation)
    if not isinstance(spec, ExtendedSpec):
        simulator = make_simulator(spec, record, columns)
        nominal = np.array([each.nominal for each in simulator.parameters])
        spec = describe_extension(simulator, nominal, record.input_names, record.output_name)
    signals = (record.input_names, record.output_name, record.dt)
    return SavedMonitor(spec, *signals, given.false_alarms, interval, state)


def parse_monitored(simulation: "MonitoredLike") -> LocalSpec:
    """Return the specification of a simulation that can be monitored."""
    if isinstance(simulation, str):
        path = find_extended_file(simulation.removeprefix("model:"))
        return parse_spec(f"model:{path}" if is_extended(path) else simulation)
    if isinstance(simulation, Mapping):
        try:
            return _LOCAL_SPEC.validate_python({"kind": "extended", **simulation})
        except ValidationError as error:
            raise SettingsError(f"the simulation is no specification: {error}") from error
    return simulation  # type: ignore[return-value]


def monitor_record(
    monitor: SavedMonitor,
    record: Dataset,
    name: str,
    time: str = "",
    columns: Mapping[str, Signal] | None = None,
) -> SavedMonitor:
    """Analyse one more record; return the monitor with its states, and with an alarm if there is a change.

    Parameters
    ----------
    monitor : SavedMonitor
    record : Dataset
    name : str
        Name of the record.
    time : str
        Time of the record, ISO 8601; empty if it is unknown.
    columns : mapping, optional
        As for `create_monitor`.

    Raises
    ------
    RecordError
        The record cannot be analysed: its columns, units or sampling time are others, it is too short, or the
        simulation diverges on it. The monitor remains valid.
    """
    reference = ColumnReference(monitor.inputs, monitor.output, monitor.dt)
    record = match_record(reference, record, "the first record")
    if record.output_name != monitor.output:
        raise RecordError(f"the output is {record.output_name}, that of the monitor {monitor.output}")
    simulator: Simulator = make_simulator(monitor.simulation, record, columns)
    return replace(monitor, state=follow_record(monitor.state, record, simulator, name, time))


def reject_record(monitor: SavedMonitor, name: str, sha256: str, reason: str) -> SavedMonitor:
    """Return the monitor with a record that could not be analysed."""
    return replace(monitor, rejected=(*monitor.rejected, RejectedRecord(name, sha256, reason)))
