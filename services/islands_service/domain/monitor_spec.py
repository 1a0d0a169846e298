"""Specifications of monitors and of their records, validated without data."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat

from islands.diagnosis.settings import AlarmRate, MonitoringSettings, Tolerances
from islands.settings_schema import setting_of
from islands.simulators.specification.table import SimulationSpec
from islands_service.domain.job_spec import (
    DatasetId,
    Discrepancy,
    Name,
    Rows,
    Seconds,
    check_single,
    parse_document,
)


def _check_time(text: str) -> str:
    try:
        datetime.fromisoformat(text)
    except ValueError:
        raise ValueError(f"{text!r} is no time: write it as 2026-11-23T01:30:00") from None
    return text


#: Time of a record.
RecordTime = Annotated[
    str, Field(max_length=40, examples=["2026-11-23T01:30:00"]), AfterValidator(_check_time)
]

#: One line of text.
Line = Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")]


class Monitoring(BaseModel):
    """Settings of a monitor."""

    tolerance: Tolerances = setting_of(MonitoringSettings, "tolerance")
    false_alarms: AlarmRate = setting_of(MonitoringSettings, "false_alarms")
    interval: FiniteFloat | None = setting_of(MonitoringSettings, "interval")
    training: int = setting_of(MonitoringSettings, "training")


class MonitorSpec(Monitoring):
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
