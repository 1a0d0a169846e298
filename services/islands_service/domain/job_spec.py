"""Specifications of jobs: everything that determines the result, validated without the data."""

import re
from collections.abc import Mapping
from typing import Annotated, Any, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    FiniteFloat,
    ValidationError,
)

from islands.diagnosis.settings import DiagnosisSettings, Tolerances
from islands.document_problems import find_problem
from islands.errors import SettingsError
from islands.evolution.presets import AUTO, PRESET_NAMES
from islands.evolution.settings import Settings
from islands.persistence.models import MODEL_CLASSES, NARX
from islands.settings_schema import make_changes_model, setting_of
from islands.simulators.specification.table import ColumnSpec, SimulationSpec, innermost
from islands_service.domain.uploaded_fmu import UploadedFmuSpec

S = TypeVar("S", bound=BaseModel)


def _unwrap_single(given: Any) -> Any:
    """Return a list of one output as its name."""
    return given[0] if isinstance(given, list | tuple) and len(given) == 1 else given


def _check_rows(text: str) -> str:
    if not re.fullmatch(_ROWS, text):
        raise ValueError(f"cannot read the rows {text[:40]!r}: write START:STOP, for example 0:5000")
    return text


_ROWS = r"^(-?[0-9]{1,12})?:(-?[0-9]{1,12})?$"

#: ``START:STOP``; either may be omitted, and a negative number counts from the end.
Rows = Annotated[
    str, AfterValidator(_check_rows), Field(json_schema_extra={"pattern": _ROWS}, examples=["0:5000"])
]
Name = Annotated[str, Field(min_length=1, max_length=200)]
Seconds = Annotated[FiniteFloat, Field(gt=0.0)]
Fraction = Annotated[FiniteFloat, Field(gt=0.0, lt=1.0)]
Seed = Annotated[int, Field(ge=0, lt=2**63, description="The same seed gives the same result, bit for bit.")]
DatasetId = Annotated[
    str, Field(pattern=r"^[0-9A-Za-z_-]{1,48}$", examples=["9f86d081884c7d659a2feaa0c55ad015-csv"])
]

#: Largest number of recordings of a job.
MAX_RECORDINGS = 64


SettingsChanges = make_changes_model(
    Settings,
    "SettingsChanges",
    ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,  # JSON cannot represent them, so no response could contain the job
        title="Settings that differ from the preset's",
    ),
)


class Part(BaseModel):
    """A data set, or a range of its rows."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    dataset: DatasetId
    rows: Rows | None = None


#: Recordings after the first one.
_FURTHER = "Further recordings of the same system with the same columns."
Recordings = Annotated[tuple[Part, ...], Field(max_length=MAX_RECORDINGS - 1, description=_FURTHER)]

Outputs = Annotated[tuple[Name, ...], Field(min_length=2, max_length=8)]

#: Description of the field ``dt``.
_DT = "Sampling time in seconds, if the record does not contain it."


class Identification(BaseModel):
    """Identify a record by evolution."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    dataset: DatasetId = Field(description="The record: the id of an uploaded data set.")
    inputs: Annotated[tuple[Name, ...], Field(min_length=1, max_length=16, examples=[["u_V"]])] = Field(
        description="Columns that are inputs; u_V+1 for the column u_V one sample early."
    )
    output: Annotated[Name | Outputs, BeforeValidator(_unwrap_single)] = Field(
        description="Column that is the output; a list of several for a model that couples them.",
        examples=["y_um"],
    )
    dt: Seconds | None = Field(default=None, description=_DT)
    rows: Rows | None = Field(default=None, description="Samples that estimate; all by default.")
    recordings: Recordings = ()
    validation: Fraction | Part = Field(
        default=0.25,
        description="The fraction at the end of every recording that selects the models, or a data set.",
    )
    preset: str = Field(default=AUTO, json_schema_extra={"enum": list(PRESET_NAMES)})
    model: str = Field(
        default=NARX,
        description="Class of the models; others than narx are fitted without a search (settings: refit, and "
        "constraints of the model latent).",
        json_schema_extra={"enum": [NARX, *MODEL_CLASSES]},
    )
    seed: Seed = 0
    settings: SettingsChanges = Field(default_factory=SettingsChanges)  # type: ignore[valid-type]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Columns that are outputs."""
        return (self.output,) if isinstance(self.output, str) else self.output

    @property
    def columns(self) -> tuple[tuple[str, ...], str]:
        """Inputs and output of the record to read. The outputs after the first one are its last inputs."""
        return (*self.inputs, *self.outputs[1:]), self.outputs[0]

    @property
    def changes(self) -> dict[str, Any]:
        """Settings that differ from those of the preset."""
        given: Mapping[str, Any] = self.settings.model_dump(exclude_none=True)  # type: ignore[attr-defined]
        return dict(given)

    @property
    def datasets(self) -> tuple[str, ...]:
        """Data sets that the job reads."""
        return tuple(part.dataset for part in self.parts)

    @property
    def estimation(self) -> tuple[Part, ...]:
        """Recordings that estimate."""
        return (Part(dataset=self.dataset, rows=self.rows), *self.recordings)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Recordings that estimate, and the validation data unless it is a fraction of them."""
        return (*self.estimation, *([self.validation] if isinstance(self.validation, Part) else []))


def check_single(given: Any) -> Any:
    """Refuse several inputs of a simulation."""
    if isinstance(given, list | tuple):
        raise ValueError("a simulation is driven by one input: give the others as channels")
    return given


class SimulatedRecord(BaseModel):
    """A simulation, and the columns and rows of a record that it is compared with."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    dataset: DatasetId = Field(description="The record: the id of an uploaded data set.")
    input: Annotated[Name, BeforeValidator(check_single)] = Field(
        description="Column that drives the simulation.", examples=["u_V"]
    )
    output: Name = Field(description="Column that was measured.", examples=["y_um"])
    channels: Annotated[tuple[Name, ...], Field(max_length=15, examples=[["T_K"]])] = Field(
        default=(), description="Columns that may influence the output, for example a temperature."
    )
    dt: Seconds | None = Field(default=None, description=_DT)
    rows: Rows | None = Field(default=None, description="Samples to analyse; all by default.")
    simulation: Annotated[SimulationSpec | UploadedFmuSpec, Field(discriminator="kind")] = Field(
        description="Simulation to compare with the record."
    )
    tolerance: Tolerances = setting_of(DiagnosisSettings, "tolerance")

    @property
    def fmu(self) -> UploadedFmuSpec | None:
        """The simulation if it is an FMU."""
        return self.simulation if isinstance(self.simulation, UploadedFmuSpec) else None

    @property
    def recorded_columns(self) -> tuple[str, ...]:
        """Column that contains a recorded simulation, if there is one."""
        return (core.column,) if isinstance(core := innermost(self.simulation), ColumnSpec) else ()

    @property
    def inputs(self) -> tuple[str, ...]:
        """Columns to read in addition to the output; the first one drives the simulation."""
        return (self.input, *self.channels, *self.recorded_columns)

    @property
    def columns(self) -> tuple[tuple[str, ...], str]:
        """Inputs and output of the record to read."""
        return self.inputs, self.output


class Discrepancy(SimulatedRecord):
    """Diagnose the discrepancy between a simulation and a record."""

    recordings: Recordings = ()
    validation: Part | None = Field(
        default=None,
        description="A recording that is held out as a whole, instead of the last quarter of the record.",
    )
    noise_level: FiniteFloat | None = setting_of(DiagnosisSettings, "noise_level")
    seed: Seed = 0

    @property
    def estimation(self) -> tuple[Part, ...]:
        """Recordings to which the simulation is fitted, except for the last quarter if it is held out."""
        return (Part(dataset=self.dataset, rows=self.rows), *self.recordings)

    @property
    def parts(self) -> tuple[Part, ...]:
        """Recordings to analyse, the one that is held out last."""
        return (*self.estimation, *([self.validation] if self.validation else []))


def parse_identification(document: Mapping[str, Any]) -> Identification:
    """Parse a stored identification job.

    Raises
    ------
    SettingsError
        The job was written by another version of islands.
    """
    return parse_document(Identification, document)


def parse_discrepancy(document: Mapping[str, Any]) -> Discrepancy:
    """Parse a stored discrepancy job.

    Raises
    ------
    SettingsError
        The job was written by another version of islands.
    """
    return parse_document(Discrepancy, document)


def parse_document(form: type[S], document: Mapping[str, Any]) -> S:
    """Parse a stored specification; an error asks to submit it again."""
    try:
        return form.model_validate(document)
    except ValidationError as error:
        problem = ": ".join(find_problem(error, form))
        raise SettingsError(
            f"this version of islands cannot read the job ({problem}): submit it again"
        ) from error
