"""Discrepancies: have a simulation held against a record, and take it along with what it lacked."""

from typing import Any

from fastapi import APIRouter, Response

from islands_api.schemas import DiscrepancyRequest, JobView
from islands_api.web.auth import Reader, Writer
from islands_api.web.dependencies import AppStateDep
from islands_api.web.job_submission import (
    ACCEPTED,
    JOBS,
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


@router.post("/v1/discrepancies", status_code=202, response_model=JobView, responses=ACCEPTED)
async def submit(
    request: DiscrepancyRequest, caller: Writer, state: AppStateDep, idempotency_key: IdempotencyKey = None
) -> Any:
    """Submit a job that finds out what a simulation gets wrong about a record, and why.

    It is a job as all others are, under `/v1/jobs`: followed, cancelled and resumed there. Its `result` is
    what the command line writes as `discrepancy.json`, its `report` says it in words and figures.
    """
    return await submit_job(state, caller, request, DISCREPANCY, idempotency_key)


@router.get(JOBS + "/{job}/extended", response_model=dict[str, Any])
async def extended(job: Id, caller: Reader, state: AppStateDep) -> Response:
    """Take the simulation with the effects that it lacked; there is none where nothing was named."""
    found = await get_job_of_kind(state, caller, job, DISCREPANCY)
    document = await get_result(state, found)
    blob = await state.run_blocking(state.store.results.artefact, job, EXTENDED)
    if blob is None:
        raise ResourceNotFoundError(
            f"job {job} has nothing to extend the simulation by: it found {document['verdict']}"
        )
    return Response(await state.run_blocking(state.blobs.read, blob), media_type="application/json")
