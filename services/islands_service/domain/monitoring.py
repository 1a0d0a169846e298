"""Monitors: simulations that follow the records of an owner, as values without behaviour.

::

    create          POST a record        a coordinator claims it       it has analysed the record
    ------> waiting ------------> queued ----------------------> running -----------------> training,
                                    ^                              |                        normal, alarm
                                    '----------- crash ------------'

Each record is a job. The records of a monitor are analysed one after the other, in the order of their
submission. The outcome of the job and the new state of the monitor are stored in one transaction.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from islands.errors import IslandsError


class MonitorStatus(StrEnum):
    """Status of a monitor after its last record."""

    WAITING = "waiting"
    TRAINING = "training"
    NORMAL = "normal"
    ALARM = "alarm"


class MonitorNotFoundError(IslandsError):
    """The owner has no such monitor."""


@dataclass(frozen=True, slots=True)
class Monitor:
    """A monitor as it is stored, without its states.

    Attributes
    ----------
    spec : mapping
        See `islands_service.domain.monitor_spec.MonitorSpec`.
    priority : int
        Priority of the jobs that analyse its records.
    version : int
        Raised by every analysed or rejected record.
    status : MonitorStatus
        `WAITING` before the first record.
    records, alarms : int
        Number of the records that were analysed, and of the alarms.
    pending : int
        Number of the records that are queued or being analysed.
    created, updated : float
        Seconds since 1970 by the clock of the database.
    written_by : str or None
        Version of islands that wrote the states; None before the first record.
    last_alarm : mapping or None
        The last alarm, as in the document for clients.
    """

    id: str
    owner: str
    name: str
    spec: Mapping[str, Any]
    priority: int
    version: int
    status: MonitorStatus
    records: int
    alarms: int
    pending: int
    created: float
    updated: float
    written_by: str | None
    last_alarm: Mapping[str, Any] | None = None


@dataclass(frozen=True, slots=True)
class MonitorStates:
    """What the analysis of a next record needs of a monitor.

    Attributes
    ----------
    head, document : str
        As in `MonitorUpdate`.
    start : int
        Index of the first record that the next one is compared with.
    records : tuple of str
        States of the records from this one.
    """

    head: str
    document: str
    start: int
    records: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class RecordEntry:
    """What is stored of an analysed or rejected record; it never changes.

    Attributes
    ----------
    name, sha256 : str
    is_rejected : bool
    state : str
        JSON of the record in `islands.report.documents.monitor_state`.
    document : str
        JSON of the record for clients.
    """

    name: str
    sha256: str
    is_rejected: bool
    state: str
    document: str


@dataclass(frozen=True, slots=True)
class MonitorUpdate:
    """New state of a monitor after a record.

    Attributes
    ----------
    monitor : str
    version : int
        Version of the monitor to which the record was added. An update of another version changes nothing.
    status : MonitorStatus
    records, alarms : int
        As in `Monitor`.
    start : int
        Index of the first record that the next one is compared with.
    head : str
        State without its records: JSON of `islands.report.documents.monitor_state`.
    document : str
        Parameters and alarms for clients: JSON of `islands.report.documents.monitor_json`.
    entry : RecordEntry
        The record.
    alarm : str or None
        JSON of the alarm that this record raised.
    """

    monitor: str
    version: int
    status: MonitorStatus
    records: int
    alarms: int
    start: int
    head: str
    document: str
    entry: RecordEntry
    alarm: str | None = None
