"""Wire models shared by the web service and the client: requests, responses and their examples."""

from datetime import datetime
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field

from islands.persistence.models import NARX
from islands.settings_schema import setting, setting_of, settings_class
from islands_service.domain.job import (
    DISCREPANCY,
    IDENTIFICATION,
    MAX_NAME_LENGTH,
    MAX_TAG_LENGTH,
    MAX_TAGS,
    MONITORING,
    PRIORITIES,
    JobState,
)
from islands_service.domain.job_spec import Discrepancy, Identification

_JOB_ID = "0b8f6c1f3d0e4b6f9a3f5a0d1c2b3a4e"
#: Regular expression of a character of a line of text.
LINE = r"[^\x00-\x1f\x7f]"

#: Regular expression of a tag.
TAG_PATTERN = r"^[^\x00-\x20\x7f,]([^\x00-\x1f\x7f,]*[^\x00-\x20\x7f,])?$"

#: Example of the id of a data set.
DATASET_ID = "9f86d081884c7d659a2feaa0c55ad015-csv"
_SPEC: dict[str, Any] = {
    "dataset": DATASET_ID,
    "inputs": ["u_V"],
    "output": "y_um",
    "preset": "auto",
    "seed": 0,
    "settings": {"islands": 2, "generations": 40},
}
_DISCREPANCY: dict[str, Any] = {
    "dataset": DATASET_ID,
    "input": "u_V",
    "output": "y_um",
    "channels": ["T_K"],
    "simulation": {"kind": "bouc-wen-piezo", "parameters": {"dp": 1.6}},
    "tolerance": {"dp": 0.01},
    "seed": 0,
}


class ResponseModel(BaseModel):
    """Base class of responses. Accepts unknown fields, which a newer service may send."""

    model_config = ConfigDict(frozen=True, extra="allow")


#: Name of a job.
JobName = Annotated[
    str,
    Field(max_length=MAX_NAME_LENGTH, pattern=rf"^{LINE}*$", description="Human-readable name; one line."),
]

#: Tag of a job.
Tag = Annotated[
    str, Field(max_length=MAX_TAG_LENGTH, pattern=TAG_PATTERN, description="One line without a comma.")
]

#: Tags of a job.
Tags = Annotated[
    tuple[Tag, ...], Field(max_length=MAX_TAGS, description="Words by which the list of jobs is filtered.")
]


class JobLabels(BaseModel):
    """New name and new tags of a job. What is absent is not changed."""

    model_config = ConfigDict(
        extra="forbid", json_schema_extra={"examples": [{"name": "stage 3, cold", "tags": ["rig-2"]}]}
    )

    name: JobName | None = None
    tags: Tags | None = None


@settings_class
class SubmissionSettings:
    """Settings of the submission of a job."""

    priority: int = setting(
        0, "Of your own jobs, higher ones run first.", ge=PRIORITIES.start, le=PRIORITIES.stop - 1
    )
    idempotency_key: str | None = setting(None, "Submitting again with the same key returns the same job.")


class JobMetadata(BaseModel):
    """Fields of a job that do not influence its result."""

    name: JobName = ""
    tags: Tags = ()
    priority: int = setting_of(SubmissionSettings, "priority")

    @property
    def spec(self) -> dict[str, Any]:
        """Fields that determine the result."""
        return self.model_dump(mode="json", exclude_unset=True, exclude={"name", "tags", "priority"})


class JobRequest(JobMetadata, Identification):
    """Request to identify a record by evolution."""

    model_config = ConfigDict(json_schema_extra={"examples": [{**_SPEC, "name": "piezo, 2 islands"}]})


class DiscrepancyRequest(JobMetadata, Discrepancy):
    """Request to diagnose what a simulation gets wrong about a record."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {**_DISCREPANCY, "name": "piezo against its model"},
                {
                    "dataset": DATASET_ID,
                    "input": "u_V",
                    "output": "y_um",
                    "simulation": {"kind": "column", "column": "y_sim_um"},
                },
            ]
        }
    )


class JobView(ResponseModel):
    """Job with its current state."""

    model_config = ConfigDict(
        frozen=True,
        extra="allow",
        json_schema_extra={
            "examples": [
                {
                    "id": _JOB_ID,
                    "kind": IDENTIFICATION,
                    "name": "piezo, 2 islands",
                    "state": "running",
                    "priority": 0,
                    "version": 7,
                    "attempt": 1,
                    "cancel_requested": False,
                    "stop_requested": False,
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
                    "stop_requested": False,
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
                        "words": "The simulation lacks a known effect, which explains the discrepancy.\n"
                        "  thermal-drift: ...",
                        "wall_s": 2.1,
                    },
                    "problem": None,
                },
            ]
        },
    )

    id: str
    kind: str = Field(description=f"{IDENTIFICATION}, {DISCREPANCY} or {MONITORING}.")
    name: str
    tags: tuple[str, ...] = ()
    dataset_name: str | None = Field(
        default=None, description="Name of the first data set at the submission; null if it is unknown."
    )
    state: JobState
    priority: int
    version: int = Field(description="Increases with every change; the number of the last event.")
    attempt: int = Field(description="Number of times a coordinator has started it.")
    cancel_requested: bool
    stop_requested: bool = Field(
        default=False, description="Whether its search ends early, and the job succeeds with the best models."
    )
    created: datetime
    updated: datetime
    started: datetime | None = None
    finished: datetime | None = None
    run_seconds: float = Field(
        default=0.0, description="Seconds that it has run, without its time in the queue, to about a second."
    )
    max_run_seconds: int | None = Field(
        default=None,
        description="Limit of `run_seconds`, at which a search ends with its best models so far, and a "
        "diagnosis or the analysis of a record fails. The operator can raise it.",
    )
    spec: dict[str, Any]
    progress: dict[str, Any] | None = Field(
        default=None,
        description="Phase, estimated position in the queue, seconds until the start (`seconds_to_start`) if "
        "they can be estimated, and the quota that the job waits for.",
    )
    summary: dict[str, Any] | None = Field(default=None, description="Summary of the result.")
    problem: dict[str, Any] | None = Field(default=None, description="Why the job failed.")
    versions: dict[str, str | None] = Field(
        default_factory=dict,
        description="Version of islands that accepted the `job` and wrote its `checkpoint` and `result`.",
    )


class JobPage(ResponseModel):
    """Page of jobs, newest first."""

    items: tuple[JobView, ...]
    next: str | None = Field(default=None, description="Cursor of the next page. None on the last page.")


class OwnedJobView(JobView):
    """Job with its owner."""

    # The examples of a job have no owner.
    model_config = ConfigDict(frozen=True, extra="allow", json_schema_extra={"examples": []})

    owner: str = Field(description="Owner of the job.")


class OwnedJobPage(ResponseModel):
    """Page of the jobs of all owners, newest first."""

    items: tuple[OwnedJobView, ...]
    next: str | None = Field(default=None, description="Cursor of the next page. None on the last page.")


class ModelView(ResponseModel):
    """Model with its metrics, physics checks and residual tests, as in ``result.json``."""

    kind: str = Field(
        default=NARX,
        description="Class of the model, such as narx; coupled-narx or coupled-latent for several outputs.",
    )
    rank: int = Field(description="1 is the model with the least error on the validation data.")
    recommended: bool = Field(
        default=False, description="Whether this is the recommended model of the job, one of all its models."
    )
    size: int = Field(description="Number of terms, of parameters with names in other classes than NARX.")
    equation: str = Field(description="With the names of the columns.")
    latex: str
    signals: str = Field(
        default="",
        description="Signals of the equation: deviations, filtered samples or means; empty for the record's.",
    )
    terms: list[dict[str, Any]] = Field(
        description="Regressor, parameter, standard error and inclusion probability of each term."
    )
    bands: dict[str, Any] | None = Field(default=None, description="Width of the prediction bands.")
    metrics: dict[str, Any] = Field(
        description="For example metrics.validation.free_run.mape; of several outputs the means."
    )
    outcomes: dict[str, Any] = Field(default_factory=dict)
    criterion: dict[str, Any] | None = Field(
        default=None, description="Estimator of the parameters, and the error that they minimise."
    )
    refit: dict[str, Any] | None = Field(
        default=None,
        description="Estimate of the parameters on all data, and the model before it, which has the errors.",
    )
    warm_up: int | None = Field(
        default=None, description="Samples before the first prediction of the simulations in metrics."
    )
    information: dict[str, Any] = Field(default_factory=dict)
    physics: dict[str, Any] = Field(default_factory=dict)
    residual_tests: dict[str, Any] = Field(default_factory=dict)


class ModelPage(ResponseModel):
    """All models of a job, least validation error first."""

    items: tuple[ModelView, ...]


class HistoryPoint(ResponseModel):
    """State of a search at a generation. Errors are mean squared, over intervals of multiple shooting."""

    generation: int
    evaluations: int
    best: dict[str, float] = Field(
        description="Error by number of terms, of latent models by number of free parameters."
    )
    islands: tuple[float | None, ...] = Field(
        description="Error by island; null if an island has no model yet."
    )


class HistoryPage(ResponseModel):
    """Page of the history of a search."""

    items: tuple[HistoryPoint, ...]


class Envelope(ResponseModel):
    """Extremes of a signal in every part of the rows. None where all samples are missing."""

    name: str
    minimum: tuple[float | None, ...]
    maximum: tuple[float | None, ...]


class PresetView(ResponseModel):
    """Preset of a search."""

    name: str = Field(examples=["narx"])
    summary: str
    settings: dict[str, Any] = Field(
        description="Its settings. Of `auto` those that do not depend on the record."
    )
    structures: tuple[str, ...] = Field(description="Values of the setting `structure`.")
    fixed: tuple[str, ...] = Field(description="Settings that cannot be changed.")


class PresetPage(ResponseModel):
    """Presets of a search, the default first."""

    items: tuple[PresetView, ...]
    settings: dict[str, dict[str, Any]] = Field(description="JSON schema of each setting, with its meaning.")


class Names(ResponseModel):
    """List of names."""

    items: tuple[str, ...]


class Health(ResponseModel):
    """State of the service."""

    status: str


class CallerView(ResponseModel):
    """Owner and scopes of a key or a token."""

    owner: str = Field(description="Owner of the jobs and data sets that the caller reaches.")
    scopes: tuple[str, ...] = Field(examples=[["read", "write"]])
