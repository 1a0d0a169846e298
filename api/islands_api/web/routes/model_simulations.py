"""Responses of models to inputs of choice."""

from typing import Annotated

from fastapi import APIRouter, Header, Response

from islands.records.averaging import average_samples
from islands.records.dataset import Dataset
from islands_api.simulation_schemas import MAX_SAMPLES, SimulatedOutput, SimulationRequest
from islands_api.web.auth import Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import get_job_of_kind, get_result
from islands_api.web.model_simulation import (
    SimulatedModel,
    describe_start,
    find_first_output,
    find_start,
    make_inputs,
    read_simulated_model,
    reads_record,
    simulate_inputs,
    write_document,
)
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import JSONRoute
from islands_api.web.routes.jobs import Id
from islands_api.web.routes.models import Rank, get_model
from islands_service.domain.job import IDENTIFICATION, Job
from islands_service.domain.job_spec import parse_identification
from islands_service.intake.job_inputs import read_beginning


class SimulationRoute(JSONRoute):
    """Route whose bodies may have the samples of inputs."""

    max_elements = MAX_SAMPLES


router = APIRouter(prefix="/v1/jobs", tags=["models"], responses=RESPONSES, route_class=SimulationRoute)


@router.post("/{job}/models/{rank}/simulate", response_model=SimulatedOutput)
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
    a constant output, with the numbers of the library.
    """
    entry = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    found = await _get_simulated_model(state, caller, entry, rank)
    recorded = await _get_beginning(state, caller, entry, rank, found) if reads_record(request) else None
    async with state.simulation_slots.hold(caller.owner):
        u, warnings = await state.run_blocking(make_inputs, found, request, recorded)
        begun = await state.run_blocking(find_start, found, u[0].tolist(), request.initial_output)
    initial = begun.output
    if initial is None:
        recorded = await _get_beginning(state, caller, entry, rank, found)
        initial = find_first_output(recorded)
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
        As `get_model`, or the model has several outputs.
    """
    key = entry.id, entry.version, rank
    model = state.simulated_models.get(key)
    if model is None:
        stored = await get_model(state, caller, entry.id, rank)
        document = await get_result(state, entry)
        model = await state.run_blocking(read_simulated_model, entry.id, stored, document)
        state.simulated_models.store(key, model)
    return model


async def _get_beginning(
    state: AppState, caller: Principal, entry: Job, rank: int, found: SimulatedModel
) -> Dataset:
    """Return the beginning of the record of a job at the rate of a model, from memory if it was read before.

    Raises
    ------
    RecordError, DatasetNotFoundError, BlobNotFoundError, ObjectStoreError
    """
    key = entry.id, entry.version, rank
    recorded = state.simulated_records.get(key)
    if recorded is None:
        spec = parse_identification(entry.spec)

        def read() -> Dataset:
            name = spec.estimation[0].dataset
            datasets = {name: state.store.datasets.get(caller.owner, name, deleted=True)}
            whole = read_beginning(spec, datasets, state.blobs, found.rows)
            return average_samples(whole, found.model.average)

        async with state.inspection_slots.hold(caller.owner):
            recorded = await state.run_blocking(read)
        state.simulated_records.store(key, recorded)
    return recorded
