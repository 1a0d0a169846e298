"""Monitor: follows a simulation from record to record and raises alarms with a given rate of false ones."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from islands.diagnosis.monitoring.change_cause import MIN_FRACTION, ChangeCause, explain_change
from islands.diagnosis.monitoring.change_detection import MIN_CHANGED, compute_statistics, find_threshold
from islands.diagnosis.monitoring.change_point import ChangeForm, locate_change
from islands.diagnosis.monitoring.changed_record import explain_record
from islands.diagnosis.monitoring.effect_states import (
    EffectStates,
    MonitorReference,
    estimate_states,
    make_reference,
)
from islands.effects.interface.context import Signal
from islands.errors import SettingsError
from islands.records.dataset import Dataset
from islands.simulators.interface import Simulator

#: Decrease of minus twice the log-likelihood per record beyond which a change is large: the record that
#: raised the alarm shows its cause.
LARGE_CHANGE = 50.0


class AlarmKind(StrEnum):
    """Kind of a change."""

    PARAMETER = "parameter changed"
    EFFECT = "effect appeared"
    NOISE = "noise changed"
    UNKNOWN = "unknown change"


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """Settings of a monitor.

    Attributes
    ----------
    false_alarms : float
        Expected number of false alarms per record, of all monitored values together.
    training : int
        Number of records that are taken as the undisturbed state. It begins again after an alarm.
    tolerance : mapping
        Relative standard deviations of parameters about their nominal values.

    Raises
    ------
    SettingsError
        The rate is not between 0 and 1.
    """

    false_alarms: float
    training: int
    tolerance: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 0.0 < self.false_alarms < 1.0:
            raise SettingsError(
                f"the rate of false alarms is a number per record between 0 and 1, got {self.false_alarms:g}"
            )


@dataclass(frozen=True, slots=True)
class MonitoredRecord:
    """A record that a monitor has analysed.

    Attributes
    ----------
    name : str
        Name of the file, or of the record over REST.
    sha256 : str
        Hash of its content.
    time : str
        Time of the record, ISO 8601; empty if it is unknown.
    states : EffectStates
    statistic : float or None
        Largest test statistic after this record, in standard deviations; None during the training.
    """

    name: str
    sha256: str
    time: str
    states: EffectStates
    statistic: float | None = None


@dataclass(frozen=True, slots=True)
class Alarm:
    """A change that a monitor has found.

    Attributes
    ----------
    record : int
        Index of the record that raised the alarm.
    kind : AlarmKind
    cause : str
        The parameter or effect; for an unknown change the nearest one, or empty.
    since, earliest, latest : int
        First changed record, and the limits of its 95 % interval.
    form : ChangeForm
    statistic : float
        Largest test statistic, in standard deviations.
    before, after : float
        Mean of the parameter, score or noise before the change and since then.
    equivalents : tuple of str
        Causes that explain the change as well.
    strength : tuple of (str, float, str)
        Name, value and unit of each parameter of an effect that appeared, in the record that raised the
        alarm; empty if one record does not show it.
    """

    record: int
    kind: AlarmKind
    cause: str
    since: int
    earliest: int
    latest: int
    form: ChangeForm
    statistic: float
    before: float
    after: float
    equivalents: tuple[str, ...] = ()
    strength: tuple[tuple[str, float, str], ...] = ()


@dataclass(frozen=True, slots=True)
class MonitorState:
    """State of a monitor after a number of records. It contains all that the analysis of a next one needs.

    Attributes
    ----------
    settings : MonitorSettings
    reference : MonitorReference or None
        None before the first record.
    records : tuple of MonitoredRecord
        In the order in which they were analysed, from the record ``first``.
    alarms : tuple of Alarm
    start : int
        Record from which the undisturbed state is taken: the first, or the first since the last alarm.
    changes : tuple of tuple of float
        Mean of `RecordAnalysis.changes` over the first records of the training.
    first : int
        Index of the first one of ``records``. Those before ``start`` are not needed to analyse a next record.
    """

    settings: MonitorSettings
    reference: MonitorReference | None = None
    records: tuple[MonitoredRecord, ...] = ()
    alarms: tuple[Alarm, ...] = ()
    start: int = 0
    changes: tuple[tuple[float, ...], ...] = ()
    first: int = 0

    @property
    def count(self) -> int:
        """Number of records that were analysed."""
        return self.first + len(self.records)

    @property
    def is_training(self) -> bool:
        """Whether no change can be found yet."""
        return self.count - self.start < self.settings.training + MIN_CHANGED

    @property
    def threshold(self) -> float:
        """Threshold of the test statistics; the rate of false alarms is divided among them."""
        assert self.reference is not None
        return find_threshold(self.settings.false_alarms / (len(self.reference.names) + 2))

    def get_record(self, index: int) -> MonitoredRecord:
        """Return the record of an index."""
        return self.records[index - self.first]

    def get_records_since_start(self) -> tuple[MonitoredRecord, ...]:
        """Return the records from `start`, which the next one is compared with."""
        return self.records[self.start - self.first :]


def follow_record(
    state: MonitorState, record: Dataset, simulator: Simulator, name: str, time: str = ""
) -> MonitorState:
    """Return the state of a monitor after one more record.

    Parameters
    ----------
    state : MonitorState
    record : Dataset
    simulator : Simulator
        The diagnosed simulation, made for this record.
    name, time : str
        As in `MonitoredRecord`.

    Raises
    ------
    RecordError
        The record cannot be analysed; the state before it remains valid.
    """
    tolerance = state.settings.tolerance
    reference = state.reference or make_reference(record, simulator, tolerance)
    analysis = estimate_states(record, simulator, tolerance, reference)
    seen = state.count
    changes = np.array(state.changes) if state.changes else np.zeros_like(analysis.changes)
    if seen < state.settings.training:
        changes = changes + (analysis.changes - changes) / (seen + 1)
    entry = MonitoredRecord(name, record.sha256, time, analysis.states)
    followed = replace(
        state,
        reference=reference,
        records=(*state.records, entry),
        changes=tuple(tuple(map(float, row)) for row in changes),
    )
    return followed if followed.is_training else _detect(followed, record, simulator)


def _detect(state: MonitorState, record: Dataset, simulator: Simulator) -> MonitorState:
    """Return the state with the statistic of its last record, and with an alarm if there is a change."""
    compared = [each.states for each in state.get_records_since_start()]
    values = np.array([each.statistics for each in compared])
    errors = np.array([each.statistic_errors for each in compared])
    statistics, starts = compute_statistics(values, errors, state.settings.training)
    strongest = int(np.argmax(np.abs(statistics)))
    largest = float(abs(statistics[strongest]))
    records = (*state.records[:-1], replace(state.records[-1], statistic=largest))
    state = replace(state, records=records)
    if largest <= state.threshold:
        return state
    cause = _find_cause(state, values, int(starts[strongest]), record, simulator)
    alarm = _describe_change(state, values, errors, statistics, cause)
    return replace(state, alarms=(*state.alarms, alarm), start=alarm.since)


def _find_cause(
    state: MonitorState, values: Signal, since: int, record: Dataset, simulator: Simulator
) -> ChangeCause | None:
    """Return the cause of a change; None if no parameter and no effect has changed."""
    reference = state.reference
    assert reference is not None
    linear = explain_change(values[:, : len(reference.names)], np.array(state.changes), since, reference)
    if linear.gain > LARGE_CHANGE * (len(values) - since):
        undisturbed = [each.states for each in state.get_records_since_start()[:since]]
        return explain_record(record, simulator, state.settings.tolerance, reference, undisturbed)
    return linear if linear.gain > state.threshold**2 else None


def _describe_change(
    state: MonitorState, values: Signal, errors: Signal, statistics: Signal, cause: ChangeCause | None
) -> Alarm:
    """Return the alarm of a change: its kind, cause and instant, and the values before and since then."""
    assert state.reference is not None
    names = state.reference.names
    strongest = shown = int(np.argmax(np.abs(statistics)))
    kind, name = AlarmKind.UNKNOWN, "" if cause is None else cause.name
    if cause is None and strongest == len(names):
        kind, name = AlarmKind.NOISE, "noise"
    elif cause is not None and cause.fraction > MIN_FRACTION:
        kind = AlarmKind.PARAMETER if cause.is_parameter else AlarmKind.EFFECT
        shown = names.index(name) if name in names else strongest
    located = shown if abs(statistics[shown]) > state.threshold else strongest
    point = locate_change(values[:, located], errors[:, located], state.settings.training)
    sequence = np.exp(values[:, shown]) if shown >= len(names) else values[:, shown]
    return Alarm(
        record=state.count - 1,
        kind=kind,
        cause=name,
        since=state.start + point.record,
        earliest=state.start + point.earliest,
        latest=state.start + point.latest,
        form=point.form,
        statistic=float(abs(statistics[strongest])),
        before=float(np.mean(sequence[: point.record])),
        after=float(np.mean(sequence[point.record :])),
        equivalents=() if cause is None else cause.equivalents,
        strength=cause.strength if cause is not None and kind == AlarmKind.EFFECT else (),
    )
