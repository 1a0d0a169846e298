"""Jobs of all owners, for administrators: list and cancel."""

from typing import Annotated, Any

from fastapi import APIRouter, Query

from islands_api.schemas import OwnedJobPage, OwnedJobView
from islands_api.web.auth import Administrator
from islands_api.web.dependencies import AppStateDep
from islands_api.web.job_submission import describe_job, describe_jobs
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import Cursor, JSONRoute, Limit, decode_cursor, encode_cursor
from islands_api.web.responses import JSONDocument
from islands_api.web.routes.jobs import Id, StateFilter

router = APIRouter(
    prefix="/v1/admin/jobs", tags=["administration"], responses=RESPONSES, route_class=JSONRoute
)


@router.get("", response_model=OwnedJobPage)
async def jobs(
    _caller: Administrator,
    state: AppStateDep,
    owner: Annotated[
        str | None, Query(min_length=1, max_length=64, description="Only jobs of this owner.")
    ] = None,
    job_state: StateFilter = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> Any:
    """List the jobs of all owners, newest first."""
    page = await state.run_blocking(state.store.jobs.page, owner, job_state, decode_cursor(cursor), limit)
    documents = await describe_jobs(state, page.jobs)
    items = [{**document, "owner": job.owner} for document, job in zip(documents, page.jobs, strict=True)]
    return JSONDocument({"items": items, "next": encode_cursor(page.after)})


@router.post("/{job}/cancel", status_code=202, response_model=OwnedJobView)
async def cancel(job: Id, caller: Administrator, state: AppStateDep) -> Any:
    """Cancel a job of any owner, as its owner could. The audit trail has the key of the administrator."""
    cancelled = await state.run_blocking(state.store.jobs.cancel, None, job, caller.requester)
    return JSONDocument({**await describe_job(state, cancelled), "owner": cancelled.owner}, 202)
