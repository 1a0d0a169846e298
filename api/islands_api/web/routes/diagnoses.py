"""Discrepancy diagnoses: compare a simulation with a record, and download what was found."""

import hashlib
from typing import Any

from fastapi import APIRouter, Response

from islands.export.closed_form import find_closed_form
from islands.simulators.specification.table import LocalExtendedSpec
from islands_api.result_schemas import DiagnosisOutputs, ExtendedSimulation
from islands_api.schemas import DiscrepancyRequest, JobView
from islands_api.web.auth import Principal, Reader, Writer
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import (
    ACCEPTED_RESPONSES,
    JOBS_PATH,
    IdempotencyKey,
    get_job_of_kind,
    get_result,
    submit_job,
)
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.requests import (
    REVALIDATE,
    IfNoneMatch,
    JSONRoute,
    Points,
    StartRow,
    StopRow,
    matches_etag,
)
from islands_api.web.responses import JSONDocument
from islands_api.web.routes.jobs import Id
from islands_api.web.routes.models import EXPORT_RESPONSES, ExportFormat, export_response
from islands_service.domain.job import DISCREPANCY, EXTENDED, NEXT_EXPERIMENT, OUTPUTS
from islands_service.domain.plot_envelopes import describe_outputs

router = APIRouter(tags=["discrepancies"], responses=RESPONSES, route_class=JSONRoute)


@router.post("/v1/discrepancies", status_code=202, response_model=JobView, responses=ACCEPTED_RESPONSES)
async def submit(
    request: DiscrepancyRequest, caller: Writer, state: AppStateDep, idempotency_key: IdempotencyKey = None
) -> Any:
    """Submit a job that diagnoses what a simulation gets wrong about a record.

    The job is followed, cancelled and resumed under `/v1/jobs`. Its `result` has the form of the file
    `discrepancy.json` of the command line; its `report` describes the result in words and figures.
    """
    return await submit_job(state, caller, request, DISCREPANCY, idempotency_key)


@router.get(JOBS_PATH + "/{job}/extended", response_model=ExtendedSimulation)
async def extended(job: Id, caller: Reader, state: AppStateDep) -> Response:
    """Return the simulation extended by the missing effects; 404 if the diagnosis named none."""
    return Response(await _read_extended(state, caller, job), media_type="application/json")


@router.get(JOBS_PATH + "/{job}/extended/export", response_class=Response, responses=EXPORT_RESPONSES)
async def exported(job: Id, caller: Reader, state: AppStateDep, form: ExportFormat = "python") -> Response:
    """Export the extended simulation as a program, a block for a simulator, or an equation.

    It has to be one difference equation, that of a model or of a linear simulation with effects that are maps
    of the input or lines through the output; `summary.equation` of the job has it then. 404 otherwise.
    """
    spec = LocalExtendedSpec.model_validate_json(await _read_extended(state, caller, job))
    model = await state.run_blocking(find_closed_form, spec)
    if model is None:
        raise ResourceNotFoundError(
            f"the extended simulation of job {job} is not one difference equation: save its /extended as "
            "extended.json, and write it with 'islands show extended.json --format c', matlab or python"
        )
    return await export_response(state, model, form, f"extended-{job[:8]}")


async def _read_extended(state: AppState, caller: Principal, job: str) -> bytes:
    """Return the document of the extended simulation of a job.

    Raises
    ------
    ResourceNotFoundError
        The diagnosis named no effects.
    """
    document = await get_result(state, await get_job_of_kind(state, caller, job, DISCREPANCY))
    blob = await state.run_blocking(state.store.results.artefact, job, EXTENDED)
    if blob is None:
        raise ResourceNotFoundError(
            f"job {job} has no extended simulation: its verdict is {document['verdict']}"
        )
    return await state.run_blocking(state.blobs.read, blob)


@router.get(
    JOBS_PATH + "/{job}/next-experiment",
    response_class=Response,
    responses={200: {"content": {"text/csv": {"schema": {"type": "string"}}}}},
)
async def next_experiment(job: Id, caller: Reader, state: AppStateDep) -> Response:
    """Return the input of the experiment that separates causes which the record does not tell apart.

    The columns are the time `t_s` in seconds, and the input under its name in the record, with the sampling
    time of the record. `next_experiment` of the result has its limits, by how much it exceeds those of the
    record, and the predicted separation of each pair of causes. 404 if there is no such input.
    """
    document = await get_result(state, await get_job_of_kind(state, caller, job, DISCREPANCY))
    blob = await state.run_blocking(state.store.results.artefact, job, NEXT_EXPERIMENT)
    if blob is None:
        raise ResourceNotFoundError(
            f"job {job} has no input of a next experiment: {_explain_absence(document)}"
        )
    data = await state.run_blocking(state.blobs.read, blob)
    name = f"next-experiment-{job[:8]}.csv"
    headers = {"Content-Disposition": f'attachment; filename="{name}"'}
    return Response(data, media_type="text/csv; charset=utf-8", headers=headers)


def _explain_absence(document: dict[str, Any]) -> str:
    if document["next_experiment"] is None or document["decisive_experiment"] is None:
        return "the record tells its causes apart, or no cause was named"
    return "see its decisive_experiment in /result"


@router.get(
    JOBS_PATH + "/{job}/outputs",
    response_model=DiagnosisOutputs,
    responses={304: {"description": "Not modified."}},
)
async def outputs(
    job: Id,
    caller: Reader,
    state: AppStateDep,
    start: StartRow = 0,
    stop: StopRow = None,
    points: Points = 2000,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Return the measured and the simulated outputs, and the residuals, for a plot.

    Of every part of the samples the answer has the least and the greatest value, so that no peak is lost.
    Samples are those of the analysed rows of all recordings. The simulation is calibrated.
    """
    await get_result(state, await get_job_of_kind(state, caller, job, DISCREPANCY))
    blob = await state.run_blocking(state.store.results.artefact, job, OUTPUTS)
    if blob is None:
        raise ResourceNotFoundError(f"job {job} has no outputs: submit it again")
    tag = f'"{hashlib.sha256(repr((blob, start, stop, points)).encode()).hexdigest()[:32]}"'
    # A cancelled job that is resumed replaces its outputs.
    headers = {"Cache-Control": REVALIDATE, "Vary": "Authorization", "ETag": tag}
    if matches_etag(if_none_match, tag):
        return Response(status_code=304, headers=headers)
    return JSONDocument(
        await state.run_blocking(_read_outputs, state, blob, start, stop, points), headers=headers
    )


def _read_outputs(state: AppState, blob: str, start: int, stop: int | None, points: int) -> dict[str, Any]:
    with state.blobs.hold(blob) as path:
        return describe_outputs(path, start, stop, points)
