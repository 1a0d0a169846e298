"""Schemas of results: identification, diagnosis, record of a monitor, extended simulation, free run.

They state the fields of the OpenAPI document. `docs/reference/result-json.md` describes each of them.
"""

from typing import Any, Literal

from pydantic import Field

from islands.persistence.models import NARX
from islands_api.schemas import Envelope, ModelView, ResponseModel


class IdentificationResult(ResponseModel):
    """Result of an identification of one or several outputs, as in ``result.json``."""

    schema_version: Literal["islands.result/1"] = Field(alias="schema")
    record: dict[str, Any] = Field(description="Hash, length, sampling time, names and units of the record.")
    preprocessing: dict[str, Any] | None = Field(default=None, description="Averages, filters, trends.")
    seed: int
    settings: dict[str, Any] = Field(description="What determines the result besides the record.")
    search: dict[str, Any] = Field(description="Statistics of the search.")
    not_computed: tuple[dict[str, str], ...] = Field(
        default=(), description="Steps that failed, each with its step and the reason."
    )
    recommended: dict[str, Any] | None = Field(
        default=None, description="Rank of the recommended model, and the reasons."
    )
    outputs: tuple[dict[str, Any], ...] = Field(
        default=(), description="Name, unit, errors and bands of each of several outputs; otherwise absent."
    )
    models: tuple[ModelView, ...] = Field(description="The models, least validation error first.")
    ensemble: list[dict[str, Any]] | None = Field(
        default=None, description="Structures with their weights and parameters."
    )


class FindingView(ResponseModel):
    """Cause of a discrepancy, or property of the noise."""

    name: str
    place: str = Field(default="", description="State or parameter that it acts on.")
    family: str
    confidence: float
    equivalents: tuple[str, ...] = Field(description="Causes that the record cannot distinguish from it.")
    parameters: dict[str, dict[str, Any]] = Field(description="Value, unit and 95 % interval by name.")
    score: float
    eta: float | None = Field(description="Fraction of the misfit; null for a property of the noise.")
    claimed: bool = True
    error_share: float | None = Field(
        default=None, description="Fraction of the mean squared error, noise included."
    )
    noise_share: float | None = Field(default=None, description="Fraction of that error that is noise.")
    term: str = Field(default="", description="A missing term with its equation.")
    depends_on_time: bool = Field(default=False, description="Whether it is a function of the time.")
    summary: str = Field(default="", description="What the cause is.")
    distinguished_by: str = Field(default="", description="What distinguishes it from similar causes.")
    occurs_in: str = Field(default="", description="Parts of machines that have it.")
    resembles: dict[str, Any] | None = Field(
        default=None, description="Simple law with the shape of a free curve, its parameter and formula."
    )


class DiscrepancyResult(ResponseModel):
    """Result of a diagnosis, as in ``discrepancy.json``."""

    schema_version: Literal["islands.discrepancy/1"] = Field(alias="schema")
    record: dict[str, Any] = Field(description="Hash, length, sampling time, names and units of the record.")
    simulation: str
    verdict: str
    effects: tuple[FindingView, ...] = Field(description="The causes, then the properties of the noise.")
    gain: dict[str, Any] | None = Field(description="Errors before and after on held-out data.")
    next_experiment: dict[str, Any] | None = Field(
        default=None,
        description="Pairs of causes that the record does not tell apart, with their separation, and the "
        "input that separates them, with its limits.",
    )
    candidates: tuple[dict[str, Any], ...] = Field(description="All screened effects, the best first.")
    titles: dict[str, str] = Field(default={}, description="Plain names of the causes, by their names.")
    calibrated: dict[str, float] = Field(description="Values of the parameters of the simulation.")
    values: tuple[dict[str, Any], ...] = Field(
        default=(), description="The same with units and intervals, before and after the calibration."
    )
    record_findings: tuple[dict[str, Any], ...] = Field(default=(), description="Findings about the record.")
    left_out: tuple[str, ...] = Field(default=(), description="Steps that a cancelled diagnosis left out.")
    not_computed: tuple[dict[str, str], ...] = Field(
        default=(), description="Steps that failed, each with its step and the reason."
    )


class MonitoredRecordResult(ResponseModel):
    """Result of a record of a monitor."""

    schema_version: Literal["islands.monitor/1"] = Field(alias="schema")
    monitor: str
    status: str
    record: dict[str, Any] = Field(description="States of the record.")
    alarms: tuple[dict[str, Any], ...] = Field(description="Alarms that the record raised.")


class SavedMonitorState(ResponseModel):
    """State of a monitor, as in ``state.json``. Its further fields are for `islands monitor` alone."""

    schema_version: Literal["islands.monitor-state/1"] = Field(alias="schema")


class ExtendedSimulation(ResponseModel):
    """A simulation with the effects that it lacks, as in ``extended.json``."""

    kind: Literal["extended"] = "extended"
    schema_version: Literal["islands.extended/1"] = Field(alias="schema")
    inputs: tuple[str, ...]
    output: str
    core: dict[str, Any] = Field(description="The simulation without effects.")
    effects: tuple[dict[str, Any], ...] = Field(description="Name and parameters of each effect.")
    start: dict[str, float] = Field(default_factory=dict, description="States at the first sample.")
    scales: dict[str, Any] = Field(description="Sizes of the signals of the record.")


class Band(ResponseModel):
    """Prediction band of a free run; null where it diverged."""

    level: float
    lower: tuple[float | None, ...]
    upper: tuple[float | None, ...]


class FreeRun(ResponseModel):
    """Free run of a model over the validation data."""

    outcome: str
    every: int = Field(description="The arrays have one of this number of samples.")
    time_s: tuple[float, ...]
    inputs: dict[str, tuple[float, ...]]
    measured: tuple[float | None, ...]
    free_run: tuple[float | None, ...] = Field(description="Null where the free run diverged.")
    band: Band | None = None


class SearchFreeRunView(ResponseModel):
    """Free run of the best model so far of a running search over its estimation data, for a plot."""

    job: str
    output: str
    generation: int = Field(description="Generation of the search, as in `progress.free_run`.")
    kind: str = Field(default=NARX, description="Class of the model.")
    size: int = Field(
        description="Number of terms of the smallest model whose error is near the least one; of free "
        "parameters if it is latent."
    )
    error: float = Field(description="RMS error of the model in the search.")
    outcome: str = Field(description="`ok`, or where the free run diverged.")
    dt: float = Field(description="Sampling time in seconds.")
    start: float = Field(description="Time of the first sample in seconds.")
    samples: int
    rows: tuple[int, ...] = Field(description="First sample, from 0, of each of at most 500 parts.")
    outputs: tuple[Envelope, ...] = Field(
        description="`measured` and `free_run`, which starts from the first measured outputs: the least and "
        "the greatest value of every part, with six digits; null after a divergence."
    )


class DiagnosisOutputs(ResponseModel):
    """Measured and simulated outputs of a diagnosis, for a plot."""

    start: int = Field(description="First sample, counted from 0.")
    stop: int = Field(description="Sample after the last one.")
    rows: tuple[int, ...] = Field(
        description="First sample of every part. If the samples are fewer than `points`, each is a part."
    )
    outputs: tuple[Envelope, ...] = Field(
        description="`measured`; `simulated`, calibrated without effects; `extended` by the effects, or "
        "`corrected` for a gross error, if there are any."
    )
    residuals: tuple[Envelope, ...] = Field(
        description="Measured less simulated output, under the name of the simulated one."
    )


class ProblemType(ResponseModel):
    """Description of a kind of problem."""

    type: str
    status: int
    title: str


class LinearSystemView(ResponseModel):
    """Linear system of a model about an operating point, whose signals are deviations from it."""

    schema_version: Literal["islands.linear-system/1"] = Field(alias="schema")
    dt: float | None = Field(
        description="Sampling time in seconds; 0 of a continuous system, null if unknown."
    )
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    dead_times: tuple[float, ...] = Field(description="Of every input in seconds.")
    operating_inputs: tuple[float, ...]
    operating_outputs: tuple[float, ...]
    poles: tuple[tuple[float, float], ...] = Field(description="Real and imaginary part of every pole.")
    natural_frequencies: tuple[float | None, ...] = Field(
        description="Of every pole in hertz; null of a delay."
    )
    damping: tuple[float | None, ...] = Field(
        description="Damping ratio of every pole; null of an integrator."
    )
    static_gain: tuple[tuple[float | None, ...], ...] = Field(
        description="A row for each output, a column for each input; null with an integrator."
    )
    words: tuple[str, ...] = Field(description="Time constants, resonances, dead times and gains.")
    A: tuple[tuple[float, ...], ...] | None = Field(
        default=None, description="x(k+1) = A x(k) + B u(k-d); of a continuous system dx/dt."
    )
    B: tuple[tuple[float, ...], ...] | None = None
    C: tuple[tuple[float, ...], ...] | None = Field(default=None, description="y(k) = C x(k) + D u(k-d)")
    D: tuple[tuple[float, ...], ...] | None = None
    numerators: tuple[tuple[tuple[float, ...], ...], ...] | None = Field(
        default=None,
        description="Of a transfer function, by output and input, the highest power of z, or of s, first.",
    )
    denominator: tuple[float, ...] | None = Field(default=None, description="Common to all of them.")
