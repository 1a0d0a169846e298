"""Wire models of data sets and of uploaded FMUs."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from islands_api.schemas import DATASET_ID, Envelope, ResponseModel
from islands_service.domain.job_spec import Name

_FMU_ID = "9f86d081884c7d659a2feaa0c55ad015-fmu"


class Column(ResponseModel):
    """Column of a data set."""

    name: str
    unit: str
    samples: int | None = Field(description="None if the column cannot be read.")
    minimum: float | None = None
    maximum: float | None = None
    mean: float | None = None
    deviation: float | None = Field(default=None, description="Standard deviation.")
    missing: int = Field(
        default=0,
        description="Samples without a value. Those of an output are skipped; an input needs `gaps`.",
    )
    dt: float | None = Field(
        default=None, description="Sampling time of the column in seconds. None if it is unknown."
    )
    problem: str = Field(
        default="", description="Why the column can be neither input nor output. Empty if it can."
    )


class RecordFact(ResponseModel):
    """Measured property of a record."""

    name: str = Field(description="Property, for example `dead-time`.", examples=["dead-time"])
    signal: str = Field(description="Column that it describes. Empty for the whole record.")
    value: bool | float | None = Field(description="None if the record does not determine it.")
    unit: str
    interval: tuple[float, float] | None = Field(default=None, description="95 % interval of the value.")
    confidence: float | None = Field(default=None, description="Probability that the value is right.")
    sentence: str = Field(description="The fact in one sentence.")


class ChosenColumns(ResponseModel):
    """Inputs and output that the facts describe."""

    inputs: tuple[str, ...]
    output: str = Field(description="Empty, like the inputs, if none are chosen. `reason` says why.")
    confidence: float | None = Field(
        default=None, description="Probability that the choice is right. None if it was given."
    )
    reason: str


class AdviceView(ResponseModel):
    """Option that a note advises."""

    option: str = Field(
        description="Option of reading, for `POST /v1/datasets/{dataset}/readings`, or the `dt` of a job.",
        examples=["gaps"],
    )
    value: str | float | None = Field(description="None if only the user knows it.", examples=["split"])


class NoteView(ResponseModel):
    """Problem of a record, or remark on how it is read."""

    text: str
    is_problem: bool = Field(
        description="Whether the record cannot be used as it is; otherwise the note states what was inferred."
    )
    rows: tuple[int, ...] = Field(
        default=(), description="First rows that it concerns, from 0 without the header."
    )
    advice: tuple[AdviceView, ...] = Field(default=(), description="Options that the text names.")


class SamplingView(ResponseModel):
    """Regularity of the time stamps of a record. Rows are named as in the file, the first of each kind."""

    dt: float | None = Field(default=None, description="Usual step in seconds. None if it is unknown.")
    jitter: float | None = Field(
        default=None, description="Root mean square deviation of the steps, relative to the sampling time."
    )
    gaps: tuple[str, ...] = Field(default=(), description="Rows before which samples are missing.")
    repeated: tuple[str, ...] = Field(default=(), description="Rows that repeat a time stamp.")
    backward: tuple[str, ...] = Field(default=(), description="Rows whose time is before that of the last.")
    counts: dict[str, int] = Field(default_factory=dict, description="Number of rows of each kind.")


class Inspection(ResponseModel):
    """Facts about the record in a file."""

    rows: str | None = Field(
        default=None, description="`START:STOP`, the samples that were measured. None if all were."
    )
    choice: ChosenColumns
    facts: tuple[RecordFact, ...]
    sampling: SamplingView | None = None
    remedy: dict[str, Any] = Field(
        default_factory=dict,
        description="Options of reading with which the record can be used. Empty if it can be used as it is, "
        "or if none of the options that were tried helps.",
    )


class Preview(ResponseModel):
    """Content of a file."""

    samples: int | None
    columns: tuple[Column, ...]
    time: str | None = Field(default=None, description="Name of the time column.")
    dt: float | None = Field(default=None, description="Sampling time in seconds. None if it is unknown.")
    warnings: tuple[str, ...] = ()
    notes: tuple[NoteView, ...] = Field(
        default=(), description="The warnings with their rows and the options that they advise."
    )
    reading: dict[str, Any] = Field(default_factory=dict, description="Options of reading.")
    inspection: Inspection | None = Field(
        default=None,
        description="Facts about the record. None if the file has problems that `warnings` state.",
    )


class Samples(ResponseModel):
    """Columns of a data set for a plot."""

    start: int = Field(description="First row, counted from 0 without the header.")
    stop: int = Field(description="Row after the last one.")
    rows: tuple[int, ...] = Field(
        description="First row of every part. If the rows are fewer than `points`, each is a part."
    )
    columns: tuple[Envelope, ...]


_EXPIRES = "Earliest deletion, if no job names the data set until then. None if it is kept."


class ReadingRequest(BaseModel):
    """Request to read a data set in another way."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"reading": {"gaps": "split", "resample": 0.01}}]}
    )

    inputs: Annotated[list[Name], Field(max_length=16, description="Columns to check as inputs.")] = []
    output: Annotated[Name | None, Field(description="Column to check as the output.")] = None
    dt: Annotated[FiniteFloat | None, Field(description="Sampling time in seconds.", gt=0.0)] = None
    reading: Annotated[
        dict[str, Any], Field(description='Options of reading: `{"names": ["t", "u", "y"]}`.')
    ] = {}


class FetchRequest(ReadingRequest):
    """Request for the download of a record."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [
                {"url": "https://data.example.org/piezo.csv", "inputs": ["u_V"], "output": "y_um"},
                {"url": "s3://measurements/lab/piezo.npz"},
            ]
        },
    )

    url: Annotated[
        str,
        Field(
            min_length=1,
            max_length=2000,
            pattern=r"^[\x21-\x7e]+$",
            description="`https://HOST/PATH` or `s3://BUCKET/KEY`, of a host or bucket that is listed.",
        ),
    ]
    name: Annotated[
        str | None,
        Field(max_length=200, description="File name; by default the last part of the URL's path."),
    ] = None


class DatasetView(ResponseModel):
    """Uploaded record."""

    id: str = Field(examples=[DATASET_ID])
    name: str
    sha256: str
    bytes: int
    created: datetime
    source: str | None = Field(default=None, description="URL of the download, without its query.")
    expires: datetime | None = Field(default=None, description=_EXPIRES)
    preview: Preview


class DatasetSummary(ResponseModel):
    """Uploaded record in a list."""

    id: str = Field(examples=[DATASET_ID])
    name: str
    sha256: str
    bytes: int
    created: datetime
    source: str | None = Field(default=None, description="URL of the download, without its query.")
    expires: datetime | None = Field(default=None, description=_EXPIRES)
    samples: int | None
    columns: int = Field(description="Number of columns. The data set itself lists them.")
    time: str | None = Field(description="Name of the time column.")
    dt: float | None = Field(description="Sampling time in seconds. None if it is unknown.")
    warnings: int = Field(description="Number of warnings.")
    reading: dict[str, Any] = Field(default_factory=dict, description="Options of reading.")


class DatasetPage(ResponseModel):
    """Page of data sets, newest first."""

    items: tuple[DatasetSummary, ...]
    next: str | None = Field(default=None, description="Cursor of the next page. None on the last page.")


class FmuVariableView(ResponseModel):
    """Variable of type real of an FMU."""

    name: str
    unit: str
    start: float | None = Field(description="Value that it has unless another one is set.")
    lower: float | None = Field(description="Least value. None without a limit.")
    upper: float | None = Field(description="Greatest value. None without a limit.")


class FmuSummary(ResponseModel):
    """Uploaded FMU in a list."""

    id: str = Field(description="The `file` of a simulation of the `kind` fmu.", examples=[_FMU_ID])
    name: str
    sha256: str
    bytes: int
    created: datetime


class FmuView(FmuSummary):
    """Uploaded FMU."""

    fmi: int = Field(description="Version of FMI: 2 or 3.")
    interface: str = Field(description="Interface by which it is simulated: model exchange if it has both.")
    inputs: tuple[FmuVariableView, ...]
    outputs: tuple[FmuVariableView, ...]
    parameters: tuple[FmuVariableView, ...] = Field(description="Parameters that can be calibrated.")
    initial: tuple[FmuVariableView, ...] = Field(
        description="Values at the first sample of a record that can be calibrated."
    )
    most_parameters: int = Field(
        description="If there are more, a simulation has to name those it calibrates."
    )


class FmuPage(ResponseModel):
    """Page of FMUs, newest first."""

    items: tuple[FmuSummary, ...]
    next: str | None = Field(default=None, description="Cursor of the next page. None on the last page.")
