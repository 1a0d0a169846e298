"""Jobs: submit, look, wait, list, cancel, resume, delete."""

from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Query, Response

from islands_api.schemas import HistoryPage, JobPage, JobRequest, JobView
from islands_api.web.auth import Reader, Writer
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import ACCEPTED, ETAG, IdempotencyKey, etag, get_job_of_kind, submit_job
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import Cursor, JSONRoute, Limit, decode_cursor, encode_cursor
from islands_api.web.responses import JSONDocument, JSONItems, job_document
from islands_service.domain.job import IDENTIFICATION, TERMINAL, Job, JobState

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], responses=RESPONSES, route_class=JSONRoute)

#: A job's id.
Id = Annotated[
    str,
    Path(
        pattern=r"^[0-9A-Za-z_-]{1,64}$",
        description="A job's `id`.",
        examples=["0b8f6c1f3d0e4b6f9a3f5a0d1c2b3a4e"],
    ),
]

_SEEN: dict[int | str, dict[str, Any]] = {
    200: {"headers": {"ETag": ETAG}},
    304: {"description": "As it was.", "headers": {"ETag": ETAG}},
}

#: The most and the fewest points of a page of the history, and the most errors of islands in it: with many
#: islands it would hold up everybody else for seconds.
_POINTS, _FEWEST, _ERRORS = 5000, 50, 100_000


@router.post("", status_code=202, response_model=JobView, responses=ACCEPTED)
async def submit(
    request: JobRequest, caller: Writer, state: AppStateDep, idempotency_key: IdempotencyKey = None
) -> Any:
    """Submit a job that identifies a record. Once this answers 202 it is not lost, whatever happens.

    It waits until a coordinator is free; follow it by its `events`, or by `GET` with `wait`.
    """
    return await submit_job(state, caller, request, IDENTIFICATION, idempotency_key)


@router.get("", response_model=JobPage)
async def jobs(
    caller: Reader,
    state: AppStateDep,
    job_state: Annotated[JobState | None, Query(alias="state", description="Of this state alone.")] = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> Any:
    """List the jobs of every kind, newest first."""
    page = await state.run_blocking(
        state.store.jobs.page, caller.owner, job_state, decode_cursor(cursor), limit
    )
    return JSONDocument(
        {"items": [job_document(job) for job in page.jobs], "next": encode_cursor(page.after)}
    )


@router.get("/{job}", response_model=JobView, responses=_SEEN)
async def job(
    job: Id,
    caller: Reader,
    state: AppStateDep,
    wait: Annotated[
        float, Query(ge=0.0, le=60.0, description="Seconds to wait for a change since `If-None-Match`.")
    ] = 0.0,
    if_none_match: Annotated[
        str | None, Header(max_length=1000, description="The `ETag` of what is known already.")
    ] = None,
) -> Any:
    """Look at a job. With `If-None-Match` the answer is 304 as long as nothing has changed."""
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    if wait and _known(if_none_match, found) and found.state not in TERMINAL:
        found = await _changed(state, found, wait)
    headers = {"ETag": etag(found), "Cache-Control": "private, no-cache"}
    if found.state not in TERMINAL:
        headers["Retry-After"] = "1"
    if _known(if_none_match, found):
        return Response(status_code=304, headers=headers)
    return JSONDocument(job_document(found), headers=headers)


@router.post("/{job}/cancel", status_code=202, response_model=JobView)
async def cancel(job: Id, caller: Writer, state: AppStateDep) -> Any:
    """Cancel a job: at once if it waits; if it runs, within a second or so."""
    return JSONDocument(
        job_document(await state.run_blocking(state.store.jobs.cancel, caller.owner, job)), 202
    )


@router.post("/{job}/resume", status_code=202, response_model=JobView)
async def resume(job: Id, caller: Writer, state: AppStateDep) -> Any:
    """Have a job that failed or was cancelled go on from its last checkpoint."""
    resumed = await state.run_blocking(state.store.jobs.resume, caller.owner, job, state.settings.max_active)
    return JSONDocument(job_document(resumed), 202)


@router.delete("/{job}", status_code=204)
async def delete(job: Id, caller: Writer, state: AppStateDep) -> None:
    """Delete a finished job with its result."""
    await state.run_blocking(state.store.jobs.delete, caller.owner, job)


@router.get("/{job}/history", response_model=HistoryPage)
async def history(
    job: Id,
    caller: Reader,
    state: AppStateDep,
    after: Annotated[
        int, Query(ge=-1, le=2**31 - 1, description="From the generation behind this one on.")
    ] = -1,
) -> Any:
    """Look at the course of a search: the error of every size and of every island over generations.

    It comes in pages: ask for what is behind the last generation of one, until a page is empty.
    """
    found = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    return await state.run_blocking(_course, state, found, after)


def _course(state: AppState, job: Job, after: int) -> JSONItems:
    islands = (job.spec.get("settings") or {}).get("islands") or 1
    most = min(_POINTS, max(_FEWEST, _ERRORS // islands))
    names = ("generation", "evaluations", "best", "islands")
    points = state.store.results.history(job.id, after, most)
    return JSONItems([dict(zip(names, point, strict=True)) for point in points])


async def _changed(state: AppState, job: Job, seconds: float) -> Job:
    with state.hub.subscribe(job.id, job.version) as feed:
        await state.hub.wait(feed, job.version, seconds)
    return await state.run_blocking(state.store.jobs.get, job.owner, job.id)


def _known(given: str | None, job: Job) -> bool:
    """Tell whether a client has a job as it is: it may send several tags, and a proxy may weaken them."""
    tags = [tag.strip().removeprefix("W/") for tag in (given or "").split(",")]
    return "*" in tags or etag(job) in tags
