"""Models of a job (metrics, physics checks, exports), and the whole result."""

from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Query, Response

from islands.export import EXPORTS, MODEL_FILE, Exported, export
from islands.persistence.models import any_model_from_json
from islands.records.averaging import average_samples
from islands.records.coupled import AnyRecord
from islands_api.result_schemas import (
    DiscrepancyResult,
    IdentificationResult,
    MonitoredRecordResult,
)
from islands_api.schemas import ModelPage, ModelView
from islands_api.simulation_schemas import MAX_SAMPLES, SimulatedOutput, SimulationRequest
from islands_api.web.auth import Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import get_job_of_kind, get_result
from islands_api.web.model_simulation import (
    SimulatedModel,
    describe_start,
    find_first_outputs,
    find_start,
    make_inputs,
    read_simulated_model,
    reads_record,
    simulate_inputs,
    write_document,
)
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.requests import JSONRoute, StrictRoute
from islands_api.web.responses import JSONDocument, JSONItems
from islands_api.web.routes.jobs import Id
from islands_service.domain.job import IDENTIFICATION, Job
from islands_service.domain.job_spec import parse_identification
from islands_service.intake.job_inputs import read_beginning
from islands_service.store.results import StoredModel

router = APIRouter(prefix="/v1/jobs", tags=["models"], responses=RESPONSES, route_class=StrictRoute)

#: Results of all kinds of jobs.
AnyResult = IdentificationResult | DiscrepancyResult | MonitoredRecordResult

#: Path parameter: the rank of a model in its result.
Rank = Annotated[int, Path(ge=1, le=10_000, description="1 has the least error on the validation data.")]

#: Media types of the export formats that are not plain text.
_MEDIA_TYPES = {"json": "application/json", "mathml": "application/mathml+xml"}

#: File name suffixes of the export formats; others have .txt.
_SUFFIXES = {
    "python": "py",
    "c": "c",
    "s-function": "c",
    "matlab": "m",
    "matlab-system": "m",
    "modelica": "mo",
    "latex": "tex",
    "json": "json",
    "mathml": "xml",
}

#: Query parameter: a format of `islands.export`.
ExportFormat = Annotated[
    str,
    Query(alias="format", description="Format of the export.", json_schema_extra={"enum": list(EXPORTS)}),
]

_TEXT_SCHEMA: dict[str, Any] = {"schema": {"type": "string"}}
EXPORT_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {
        "content": {
            "text/plain": _TEXT_SCHEMA,
            _MEDIA_TYPES["mathml"]: _TEXT_SCHEMA,
            _MEDIA_TYPES["json"]: {"schema": {"type": "object"}},
        }
    }
}


@router.get("/{job}/models", response_model=ModelPage)
async def models(job: Id, caller: Reader, state: AppStateDep) -> Any:
    """Return the models of a job in the order of their ranks.

    A job has models when it has succeeded, or was cancelled after its first models.
    """
    await get_job_of_kind(state, caller, job, IDENTIFICATION)
    return await state.run_blocking(
        lambda: JSONItems([model.document for model in state.store.results.models(job)])
    )


@router.get("/{job}/models/{rank}", response_model=ModelView)
async def model(job: Id, rank: Rank, caller: Reader, state: AppStateDep) -> Any:
    """Return one model."""
    return JSONDocument((await get_model(state, caller, job, rank)).document)


@router.get(
    "/{job}/models/{rank}/export",
    response_class=Response,
    responses=EXPORT_RESPONSES,
)
async def exported(
    job: Id,
    rank: Rank,
    caller: Reader,
    state: AppStateDep,
    form: ExportFormat = "python",
) -> Response:
    """Export a model as a program, a block for a simulator, an equation, or a model file."""
    found = await get_model(state, caller, job, rank)
    name = f"model-{rank:02d}"
    if form == MODEL_FILE:
        # As it was written, with its uncertainty.
        return _text_response(found.file, form, name)
    model = any_model_from_json(found.file, f"model {rank}")
    return await export_response(state, model, form, name)


@router.get(
    "/{job}/result",
    response_model=IdentificationResult | DiscrepancyResult | MonitoredRecordResult,
)
async def result(job: Id, caller: Reader, state: AppStateDep) -> Any:
    """Return the whole result, in the form of `result.json` or `discrepancy.json`."""
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    document = await get_result(state, found)
    if found.kind != IDENTIFICATION:
        return JSONDocument(document)
    models = await state.run_blocking(state.store.results.models, job)
    return JSONDocument({**document, "models": [model.document for model in models]})


async def get_model(state: AppState, caller: Principal, job: str, rank: int) -> StoredModel:
    """Return a model of a finished job.

    Raises
    ------
    ResultNotReadyError
        The job has not succeeded.
    ResourceNotFoundError
        The job has no model of this rank.
    """
    await get_result(state, await get_job_of_kind(state, caller, job, IDENTIFICATION))
    found = await state.run_blocking(state.store.results.models, job, rank)
    if not found:
        raise ResourceNotFoundError(f"job {job} has no model {rank}: see its /models")
    return found[0]


async def export_response(state: AppState, model: Exported, form: str, name: str) -> Response:
    """Return a model in a format, as a file with a name without suffix.

    Raises
    ------
    SettingsError, ModelError
        There is no such format, or the model cannot be written in it.
    """
    return _text_response(await state.run_blocking(export, model, form), form, name)


def _text_response(text: str, form: str, name: str) -> Response:
    file = f"{name}.{_SUFFIXES.get(form, 'txt')}"
    return Response(
        text,
        media_type=_MEDIA_TYPES.get(form, "text/plain"),
        headers={"Content-Disposition": f'inline; filename="{file}"'},
    )


class SimulationRoute(JSONRoute):
    """Route whose bodies may have the samples of inputs."""

    max_elements = MAX_SAMPLES


simulation_router = APIRouter(
    prefix="/v1/jobs", tags=["models"], responses=RESPONSES, route_class=SimulationRoute
)


@simulation_router.post("/{job}/models/{rank}/simulate", response_model=SimulatedOutput)
async def simulate(
    job: Id,
    rank: Rank,
    request: SimulationRequest,
    caller: Reader,
    state: AppStateDep,
    accept_encoding: Annotated[str, Header(max_length=1000, include_in_schema=False)] = "",
) -> Response:
    """Simulate a model with inputs of choice.

    Each input is an excitation (hold, sine, triangle, steps, sweep, or the input of the record, scaled and
    shifted), or its samples at the sampling time of the model. The response is the free run of the model from
    constant outputs, with the numbers of the library.
    """
    entry = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    found = await _get_simulated_model(state, caller, entry, rank)
    recorded = await _get_beginning(state, caller, entry, rank, found) if reads_record(request) else None
    async with state.simulation_slots.hold(caller.owner):
        u, warnings = await state.run_blocking(make_inputs, found, request, recorded)
        begun = await state.run_blocking(find_start, found, u[0].tolist(), request.initial_output)
    initial = begun.outputs
    if initial is None:
        recorded = await _get_beginning(state, caller, entry, rank, found)
        initial = find_first_outputs(recorded)
    start, compressed = describe_start(found, initial, begun.reason), "gzip" in accept_encoding

    def respond() -> bytes:
        return write_document(simulate_inputs(found, u, initial, begun.is_rest, start, warnings), compressed)

    async with state.simulation_slots.hold(caller.owner):
        data = await state.run_blocking(respond)
    headers = {"Vary": "Accept-Encoding"} | ({"Content-Encoding": "gzip"} if compressed else {})
    return Response(data, media_type="application/json", headers=headers)


async def _get_simulated_model(state: AppState, caller: Principal, entry: Job, rank: int) -> SimulatedModel:
    """Return a model of a finished job, from memory if it was simulated before.

    Raises
    ------
    ResultNotReadyError, ResourceNotFoundError
        As `get_model`.
    """
    key = entry.id, entry.version, rank
    model = state.simulated_models.get(key)
    if model is None:
        stored = await get_model(state, caller, entry.id, rank)
        document = await get_result(state, entry)
        model = await state.run_blocking(read_simulated_model, stored, document)
        state.simulated_models.store(key, model)
    return model


async def _get_beginning(
    state: AppState, caller: Principal, entry: Job, rank: int, found: SimulatedModel
) -> AnyRecord:
    """Return the beginning of the record of a job at the rate of a model, from memory if it was read before.

    Raises
    ------
    RecordError, DatasetNotFoundError, BlobNotFoundError, ObjectStoreError
    """
    key = entry.id, entry.version, rank
    recorded = state.simulated_records.get(key)
    if recorded is None:
        spec = parse_identification(entry.spec)

        def read() -> AnyRecord:
            name = spec.estimation[0].dataset
            datasets = {name: state.store.datasets.get(caller.owner, name, deleted=True)}
            whole = read_beginning(spec, datasets, state.blobs, found.rows)
            return whole.map(partial(average_samples, count=found.model.average))

        async with state.inspection_slots.hold(caller.owner):
            recorded = await state.run_blocking(read)
        state.simulated_records.store(key, recorded)
    return recorded
