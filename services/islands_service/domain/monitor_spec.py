"""Specifications of monitors and of their records, validated without data."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from islands.errors import SettingsError
from islands.simulators.specification.table import SimulationSpec
from islands_service.domain.job_spec import (
    DatasetId,
    Discrepancy,
    Fraction,
    Name,
    Rows,
    Seconds,
    check_single,
    parse_document,
)

#: Defaults and limit of `islands.diagnosis.monitoring`, which this module does not import for its
#: numerical packages. A test compares them.
DEFAULT_RATE, TRAINING, MIN_TRAINING = "1 per month", 24, 12

#: Largest number of records of a training.
MAX_TRAINING = 10_000

#: Interval at which every rate per time is below one per record.
_SHORT_INTERVAL = 1e-9


def _check_rate(text: str) -> str:
    # The rate is checked again with the interval between the records, which may be that of the first one.
    from islands.diagnosis.monitoring.alarm_rate import parse_alarm_rate  # noqa: PLC0415

    try:
        parse_alarm_rate(text, _SHORT_INTERVAL)
    except SettingsError as error:
        raise ValueError(str(error)) from error
    return text


def _check_time(text: str) -> str:
    try:
        datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{text!r} is no time: write it as 2026-11-23T01:30:00") from None
    return text


#: Rate of false alarms.
AlarmRate = Annotated[
    str, Field(max_length=100, examples=["1 per month", "1 per 720 records"]), AfterValidator(_check_rate)
]

#: Time of a record.
RecordTime = Annotated[
    str, Field(max_length=40, examples=["2026-11-23T01:30:00"]), AfterValidator(_check_time)
]

Training = Annotated[
    int,
    Field(
        ge=MIN_TRAINING,
        le=MAX_TRAINING,
        description="Number of first records that are the undisturbed state.",
    ),
]

Interval = Annotated[
    Seconds | None,
    Field(description="Seconds from one record to the next; by default the duration of the first record."),
]

Tolerances = Annotated[
    dict[Name, Fraction],
    Field(
        max_length=100,
        description="Relative standard deviations of parameters about their nominal values, by name.",
    ),
]

#: One line of text.
Line = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]


class MonitorSpec(BaseModel):
    """Simulation to follow from record to record, and the rate of false alarms.

    Attributes
    ----------
    diagnosis : str or None
        Id of the job whose simulation this is.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    diagnosis: str | None = None
    simulation: SimulationSpec
    input: Annotated[Name, BeforeValidator(check_single)]
    output: Name
    channels: Annotated[tuple[Name, ...], Field(max_length=15)] = ()
    dt: Seconds | None = None
    tolerance: Tolerances = Field(default_factory=dict)
    false_alarms: AlarmRate = DEFAULT_RATE
    interval: Interval = None
    training: Training = TRAINING

    def describe_record(self, dataset: str, rows: str | None = None) -> Discrepancy:
        """Return the columns and rows to read of a record, in the form of a diagnosis."""
        return Discrepancy(
            dataset=dataset,
            rows=rows,
            input=self.input,
            output=self.output,
            channels=self.channels,
            dt=self.dt,
            simulation=self.simulation,
            tolerance=self.tolerance,
        )


class RecordSpec(BaseModel):
    """Record of a monitor."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    dataset: DatasetId = Field(description="The record: the id of an uploaded data set.")
    rows: Rows | None = Field(default=None, description="Samples to analyse; all by default.")
    name: Line = Field(default="", description="Name of the record; by default that of the data set.")
    time: RecordTime | None = Field(default=None, description="Time of the record, ISO 8601.")


def parse_monitor(document: Mapping[str, object]) -> MonitorSpec:
    """Parse a stored specification of a monitor.

    Raises
    ------
    SettingsError
        Another version of islands wrote it.
    """
    return parse_document(MonitorSpec, document)


def parse_monitor_record(document: Mapping[str, object]) -> tuple[str, RecordSpec]:
    """Parse the specification of a job that analyses a record; return the id of its monitor, and the record.

    Raises
    ------
    SettingsError
        Another version of islands wrote it.
    """
    record = {name: value for name, value in document.items() if name != "monitor"}
    return str(document["monitor"]), parse_document(RecordSpec, record)


def name_record(record: RecordSpec, file: str) -> str:
    """Return the name of a record: the given one, or the name of the file with the rows."""
    return record.name or " ".join(filter(None, (file, record.rows)))
