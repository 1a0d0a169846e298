"""State of a monitor as JSON, from which a monitor continues with the same bits.

On disk it is one file. A service stores each record once, and the rest, the head, after every record.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from islands.diagnosis.monitoring.record_follower import MonitoredRecord, MonitorState
from islands.errors import SettingsError
from islands.persistence.checkpoints import replace_file
from islands.simulators.specification.table import LocalSpec

SCHEMA = "islands.monitor-state/1"

#: Schema of a state without its records.
HEAD_SCHEMA = "islands.monitor-head/1"


@dataclass(frozen=True, slots=True)
class RejectedRecord:
    """A record that could not be analysed.

    Attributes
    ----------
    name : str
        Name of the file, or of the record over REST.
    sha256 : str
        Hash of its content.
    reason : str
    """

    name: str
    sha256: str
    reason: str


@dataclass(frozen=True, slots=True)
class SavedMonitor:
    """A monitor: the simulation that it follows, and its state.

    Attributes
    ----------
    simulation : specification
        The diagnosed simulation; estimates of the first record are part of it.
    inputs : tuple of str
        Input columns; the first one drives the simulation, further ones are channels.
    output : str
    dt : float
        Sampling time in seconds.
    false_alarms : str
        Rate of false alarms as given, such as ``1 per month``.
    interval : float
        Time from one record to the next, in seconds.
    state : MonitorState
    rejected : tuple of RejectedRecord
    """

    simulation: "LocalSpec"  # quoted: signatures would list every kind
    inputs: tuple[str, ...]
    output: str
    dt: float
    false_alarms: str
    interval: float
    state: MonitorState
    rejected: tuple[RejectedRecord, ...] = ()

    def knows(self, name: str, sha256: str) -> bool:
        """Return whether a record of this name or content was analysed, or rejected with this content."""
        analysed = any(name == each.name or sha256 == each.sha256 for each in self.state.records)
        return analysed or any((name, sha256) == (each.name, each.sha256) for each in self.rejected)


_ADAPTER: TypeAdapter[SavedMonitor] = TypeAdapter(SavedMonitor)

_RECORD: TypeAdapter[MonitoredRecord] = TypeAdapter(MonitoredRecord)


def monitor_to_json(monitor: SavedMonitor, schema: str = SCHEMA) -> str:
    """Return a monitor as JSON. Floating-point numbers keep all bits."""
    document: dict[str, Any] = {"schema": schema, **_ADAPTER.dump_python(monitor, mode="json", by_alias=True)}
    return json.dumps(document, allow_nan=False) + "\n"


def head_to_json(monitor: SavedMonitor) -> str:
    """Return a monitor without its records as JSON."""
    state = replace(monitor.state, records=(), first=0)
    return monitor_to_json(replace(monitor, state=state, rejected=()), HEAD_SCHEMA)


def record_to_json(record: MonitoredRecord) -> str:
    """Return an analysed record as JSON. Floating-point numbers keep all bits."""
    return json.dumps(_RECORD.dump_python(record, mode="json"), allow_nan=False)


def monitor_from_head(
    head: str, first: int, records: Sequence[str], title: str = "the monitor"
) -> SavedMonitor:
    """Return a monitor from its head and from its records since the one with index ``first``.

    Raises
    ------
    SettingsError
        The texts are not those of a monitor.
    """
    monitor = monitor_from_json(head, title, HEAD_SCHEMA)
    parsed = tuple(_RECORD.validate_python(json.loads(each)) for each in records)
    return replace(monitor, state=replace(monitor.state, records=parsed, first=first))


def monitor_from_json(text: str, title: str = "the monitor", schema: str = SCHEMA) -> SavedMonitor:
    """Return a monitor from its JSON.

    Raises
    ------
    SettingsError
        The text is not the state of a monitor.
    """
    try:
        document = json.loads(text)
        if not isinstance(document, dict) or document.pop("schema", None) != schema:
            raise ValueError(f"its schema is not {schema}")
        return _ADAPTER.validate_python(document)
    except (ValueError, ValidationError) as error:
        raise SettingsError(
            f"{title} is not the state of a monitor of this version: start a new one ({error})"
        ) from error


def write_monitor(monitor: SavedMonitor, path: str | Path) -> None:
    """Write a monitor; an existing file is replaced atomically, once the new one is on the disk."""
    replace_file([monitor_to_json(monitor).encode()], Path(path))


def read_monitor(path: str | Path) -> SavedMonitor:
    """Read a monitor.

    Raises
    ------
    SettingsError
        The file is not the state of a monitor.
    """
    return monitor_from_json(Path(path).read_text(encoding="utf-8"), str(path))
