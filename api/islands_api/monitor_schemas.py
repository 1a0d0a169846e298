"""Wire models of monitors and their records."""

from datetime import datetime
from typing import Annotated, Any, Self

from pydantic import BeforeValidator, ConfigDict, Field, model_validator

from islands.settings_schema import setting_of
from islands.simulators.specification.table import SimulationSpec
from islands_api.schemas import DATASET_ID, ResponseModel, SubmissionSettings
from islands_service.domain.job_spec import Name, Seconds, check_single
from islands_service.domain.monitor_spec import Line, Monitoring, RecordSpec
from islands_service.domain.monitoring import MonitorStatus

_JOB_ID = "5d1b0a7e9c3f4e52a1f60c7b8d9e0f12"

#: Fields that describe the simulation. A diagnosis has them.
_SIMULATION = ("simulation", "input", "output", "channels", "dt")


class MonitorRequest(Monitoring):
    """Request to follow a simulation from record to record: that of a diagnosis, or a given one."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"diagnosis": _JOB_ID, "false_alarms": "1 per month", "interval": 3600.0, "name": "press 4"},
                {
                    "simulation": {"kind": "second-order"},
                    "input": "F_N",
                    "output": "x_m",
                    "false_alarms": "1 per 720 records",
                },
            ]
        },
    )

    diagnosis: Annotated[
        str | None,
        Field(
            pattern=r"^[0-9A-Za-z_-]{1,64}$",
            description="Id of a discrepancy job that has succeeded. Its extended simulation is followed or, "
            "if it named no effect, its simulation, with its columns.",
        ),
    ] = None
    simulation: SimulationSpec | None = Field(
        default=None,
        description="Simulation to follow. Parameters that it does not state are those of the first record.",
    )
    input: Annotated[Name | None, BeforeValidator(check_single)] = Field(
        default=None, description="Column that drives the simulation."
    )
    output: Name | None = Field(default=None, description="Column that is measured.")
    channels: Annotated[tuple[Name, ...], Field(max_length=15)] = Field(
        default=(), description="Columns that may influence the output."
    )
    dt: Seconds | None = Field(
        default=None, description="Sampling time in seconds, if the records do not contain it."
    )
    name: Annotated[Line, Field(description="Human-readable name; one line.")] = ""
    priority: int = setting_of(SubmissionSettings, "priority")

    @model_validator(mode="after")
    def _check_simulation(self) -> Self:
        if self.diagnosis is None and None in (self.simulation, self.input, self.output):
            raise ValueError("give the diagnosis, or simulation, input and output")
        if self.diagnosis is not None and (given := {*_SIMULATION} & self.model_fields_set):
            raise ValueError(f"the diagnosis has {', '.join(sorted(given))}: leave them out")
        return self


class MonitorRecordRequest(RecordSpec):
    """Request to analyse a record of a monitor."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [{"dataset": DATASET_ID, "name": "hour 12", "time": "2026-11-23T12:00:00"}]
        }
    )


class MonitorSummary(ResponseModel):
    """Monitor without its states."""

    id: str
    name: str
    status: MonitorStatus = Field(
        description="waiting for the first record, training, normal, or alarm if the last record raised one."
    )
    records: int = Field(description="Number of analysed records.")
    alarms: int = Field(description="Number of alarms.")
    pending: int = Field(description="Number of records that are queued or being analysed.")
    priority: int
    created: datetime
    updated: datetime = Field(description="Time at which the last record was analysed.")
    last_alarm: dict[str, Any] | None = Field(
        default=None,
        description="The last alarm: its record, kind and cause, since when, and `words`. None without one.",
    )


class MonitorView(MonitorSummary):
    """Monitor with the states of its effects and its alarms."""

    spec: dict[str, Any] = Field(description="Simulation, columns and settings.")
    result: dict[str, Any] | None = Field(
        default=None,
        description="As `monitor.json` of the command line without its records: parameters, effects, and "
        "alarms with their beginning; null before the first record.",
    )


class MonitorRecordPage(ResponseModel):
    """Page of the records of a monitor, in the order in which they were analysed."""

    items: tuple[dict[str, Any], ...] = Field(
        description="As in `monitor.json`: states of the effects of an analysed record, or the reason of a "
        "rejected one, and the `index` of the record."
    )


class MonitorPage(ResponseModel):
    """Page of monitors, newest first."""

    items: tuple[MonitorSummary, ...]
    next: str | None = Field(default=None, description="Cursor of the next page. None on the last page.")
