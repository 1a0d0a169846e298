"""What goes over the wire, for the doors and for the client: requests, answers, and their examples."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from islands_service.domain.job import DISCREPANCY, IDENTIFICATION, PRIORITIES, JobState
from islands_service.domain.job_spec import Discrepancy, Identification

_JOB = "0b8f6c1f3d0e4b6f9a3f5a0d1c2b3a4e"
_DATASET = "9f86d081884c7d659a2feaa0c55ad015-csv"
_SPEC: dict[str, Any] = {
    "dataset": _DATASET,
    "inputs": ["u_V"],
    "output": "y_um",
    "preset": "hysteresis",
    "seed": 0,
    "settings": {"islands": 2, "generations": 40},
}
_DISCREPANCY: dict[str, Any] = {
    "dataset": _DATASET,
    "input": "u_V",
    "output": "y_um",
    "channels": ["T_K"],
    "simulation": {"kind": "bouc-wen-piezo", "parameters": {"dp": 1.6}},
    "tolerance": {"dp": 0.01},
    "seed": 0,
}


class Answer(BaseModel):
    """What the service sends; what a newer service adds to it is let through."""

    model_config = ConfigDict(frozen=True, extra="allow")


class Column(Answer):
    """A column of a data set."""

    name: str
    unit: str
    samples: int | None = Field(description="None where the column cannot be read.")
    minimum: float | None = None
    maximum: float | None = None
    mean: float | None = None
    deviation: float | None = Field(default=None, description="The standard deviation.")
    problem: str = Field(default="", description="Why it can be neither input nor output; empty if it can.")


class Preview(Answer):
    """What a file holds."""

    samples: int | None
    columns: tuple[Column, ...]
    time: str | None = Field(default=None, description="The column that is time.")
    dt: float | None = Field(default=None, description="Sampling time in seconds, where the file tells it.")
    warnings: tuple[str, ...] = ()


class DatasetView(Answer):
    """An uploaded record."""

    id: str = Field(examples=[_DATASET])
    name: str
    sha256: str
    bytes: int
    created: datetime
    preview: Preview


class DatasetPage(Answer):
    """Data sets, newest first."""

    items: tuple[DatasetView, ...]
    next: str | None = Field(default=None, description="The cursor of the next page, if there is one.")


class Treated(BaseModel):
    """How a job is treated, whatever it asks for."""

    name: Annotated[
        str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$", description="For people; one line.")
    ] = ""
    priority: Annotated[
        int,
        Field(ge=PRIORITIES.start, le=PRIORITIES.stop - 1, description="Higher ones go first."),
    ] = 0

    @property
    def spec(self) -> dict[str, Any]:
        """What determines the result."""
        return self.model_dump(mode="json", exclude_unset=True, exclude={"name", "priority"})


class JobRequest(Treated, Identification):
    """Identify a record by evolution: what determines the result, and how the job is treated."""

    model_config = ConfigDict(json_schema_extra={"examples": [{**_SPEC, "name": "piezo, 2 islands"}]})


class DiscrepancyRequest(Treated, Discrepancy):
    """Find out what a simulation gets wrong about a record, and how the job is treated."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {**_DISCREPANCY, "name": "piezo against its model"},
                {
                    "dataset": _DATASET,
                    "input": "u_V",
                    "output": "y_um",
                    "simulation": {"kind": "column", "column": "y_sim_um"},
                },
            ]
        }
    )


class JobView(Answer):
    """A job as it stands."""

    model_config = ConfigDict(
        frozen=True,
        extra="allow",
        json_schema_extra={
            "examples": [
                {
                    "id": _JOB,
                    "kind": IDENTIFICATION,
                    "name": "piezo, 2 islands",
                    "state": "running",
                    "priority": 0,
                    "version": 7,
                    "attempt": 1,
                    "cancel_requested": False,
                    "created": "2026-11-20T14:00:00Z",
                    "updated": "2026-11-20T14:00:07Z",
                    "started": "2026-11-20T14:00:01Z",
                    "finished": None,
                    "spec": _SPEC,
                    "progress": {"phase": "search", "generation": 12, "generations": 40, "best_error": 0.031},
                    "summary": None,
                    "problem": None,
                },
                {
                    "id": "5d1b0a7e9c3f4e52a1f60c7b8d9e0f12",
                    "kind": DISCREPANCY,
                    "name": "piezo against its model",
                    "state": "succeeded",
                    "priority": 0,
                    "version": 9,
                    "attempt": 1,
                    "cancel_requested": False,
                    "created": "2026-11-20T14:00:00Z",
                    "updated": "2026-11-20T14:00:05Z",
                    "started": "2026-11-20T14:00:01Z",
                    "finished": "2026-11-20T14:00:05Z",
                    "spec": _DISCREPANCY,
                    "progress": {"phase": "writing the report"},
                    "summary": {
                        "simulation": "bouc-wen-piezo",
                        "verdict": "named",
                        "effects": ["thermal-drift"],
                        "reduction_percent": 64.3,
                        "words": "The simulation lacks something that has a name.\n  thermal-drift: ...",
                        "wall_s": 2.1,
                    },
                    "problem": None,
                },
            ]
        },
    )

    id: str
    kind: str = Field(description=f"{IDENTIFICATION} or {DISCREPANCY}.")
    name: str
    state: JobState
    priority: int
    version: int = Field(description="Rises with every change; the number of the last event.")
    attempt: int = Field(description="How often a coordinator has taken it.")
    cancel_requested: bool
    created: datetime
    updated: datetime
    started: datetime | None = None
    finished: datetime | None = None
    spec: dict[str, Any]
    progress: dict[str, Any] | None = None
    summary: dict[str, Any] | None = Field(default=None, description="The result at a glance.")
    problem: dict[str, Any] | None = Field(default=None, description="Why it failed.")


class JobPage(Answer):
    """Jobs, newest first."""

    items: tuple[JobView, ...]
    next: str | None = Field(default=None, description="The cursor of the next page, if there is one.")


class ModelView(Answer):
    """A model with its metrics, physics checks and residual tests, as in ``result.json``."""

    rank: int = Field(description="1 is the best on the validation data.")
    size: int = Field(description="Number of terms.")
    equation: str
    latex: str
    terms: list[dict[str, Any]]
    metrics: dict[str, Any] = Field(description="metrics.validation.free_run.mape, and so on.")
    outcomes: dict[str, Any]
    information: dict[str, Any]
    physics: dict[str, Any]
    residual_tests: dict[str, Any]


class ModelPage(Answer):
    """All models of a job, best first."""

    items: tuple[ModelView, ...]


class HistoryPoint(Answer):
    """The search at a generation; errors are mean squared, over intervals of multiple shooting."""

    generation: int
    evaluations: int
    best: dict[str, float] = Field(description="By number of terms.")
    islands: tuple[float | None, ...] = Field(description="By island; null where it has no model yet.")


class HistoryPage(Answer):
    """The course of a search, from a generation on."""

    items: tuple[HistoryPoint, ...]


class Names(Answer):
    """What there is to ask for."""

    items: tuple[str, ...]


class Health(Answer):
    """How the service is."""

    status: str
