"""Discrepancy diagnoses: compare a simulation with a record, and download the extended simulation."""

from typing import Any

from fastapi import APIRouter, Response

from islands_api.result_schemas import ExtendedSimulation
from islands_api.schemas import DiscrepancyRequest, JobView
from islands_api.web.auth import Reader, Writer
from islands_api.web.dependencies import AppStateDep
from islands_api.web.job_submission import (
    ACCEPTED_RESPONSES,
    JOBS_PATH,
    IdempotencyKey,
    get_job_of_kind,
    get_result,
    submit_job,
)
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.requests import JSONRoute
from islands_api.web.routes.jobs import Id
from islands_service.domain.job import DISCREPANCY, EXTENDED

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
    found = await get_job_of_kind(state, caller, job, DISCREPANCY)
    document = await get_result(state, found)
    blob = await state.run_blocking(state.store.results.artefact, job, EXTENDED)
    if blob is None:
        raise ResourceNotFoundError(
            f"job {job} has no extended simulation: its verdict is {document['verdict']}"
        )
    return Response(await state.run_blocking(state.blobs.read, blob), media_type="application/json")
