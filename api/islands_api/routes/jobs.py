"""Jobs: submit, look, wait, list, cancel, resume, delete."""

from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Query, Response

from islands.errors import IslandsError
from islands_api.auth import Caller, Reader, Writer
from islands_api.bodies import JSONRoute
from islands_api.cursors import Cursor, Limit, cursor_of, place_of
from islands_api.documents import Document, Items, job_document
from islands_api.doors import AtDoors, Doors
from islands_api.problems import RESPONSES
from islands_api.schemas import HistoryPage, JobPage, JobRequest, JobView
from islands_service.admission import Doubt, admit
from islands_service.inspection import inspected
from islands_service.jobs import TERMINAL, Job, JobState, Submission
from islands_service.records import named

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

#: What every answer that shows a job says beside it.
_ETAG = {"description": "The job's version, for `If-None-Match`.", "schema": {"type": "string"}}
_SEEN: dict[int | str, dict[str, Any]] = {
    200: {"headers": {"ETag": _ETAG}},
    304: {"description": "As it was.", "headers": {"ETag": _ETAG}},
}
_ACCEPTED: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "Accepted. With `Idempotent-Replayed: true` it is the job that the key named before.",
        "headers": {
            "ETag": _ETAG,
            "Location": {"description": "Where the job is.", "schema": {"type": "string"}},
            "Retry-After": {"description": "Seconds after which to look.", "schema": {"type": "string"}},
        },
    }
}

#: The most and the fewest points of a page of the history, and the most errors of islands in it: with many
#: islands it would hold up everybody else for seconds.
_POINTS, _FEWEST, _ERRORS = 5000, 50, 100_000


@router.post("", status_code=202, response_model=JobView, responses=_ACCEPTED)
async def submit(
    request: JobRequest,
    caller: Writer,
    doors: AtDoors,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1, max_length=255, description="Send the same one again to be sure: it is one job."
        ),
    ] = None,
) -> Any:
    """Submit a job. Once this answers 202 the job is not lost, whatever happens to the service.

    It waits until a coordinator is free; follow it by its `events`, or by `GET` with `wait`.
    """
    submission = Submission(
        caller.owner,
        request.spec,
        name=request.name,
        priority=request.priority,
        idempotency_key=idempotency_key,
    )
    job, new = await _submitted(doors, request, submission)
    if new:
        doors.measures.accepted.inc()
    headers = {"Location": f"{router.prefix}/{job.id}", "ETag": _etag(job), "Retry-After": "1"}
    if not new:
        headers["Idempotent-Replayed"] = "true"
    return Document(job_document(job), 202, headers)


@router.get("", response_model=JobPage)
async def jobs(
    caller: Reader,
    doors: AtDoors,
    state: Annotated[JobState | None, Query(description="Of this state alone.")] = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> Any:
    """List the jobs, newest first."""
    page = await doors.do(doors.store.jobs.page, caller.owner, state, place_of(cursor), limit)
    return Document({"items": [job_document(job) for job in page.jobs], "next": cursor_of(page.after)})


@router.get("/{job}", response_model=JobView, responses=_SEEN)
async def job(
    job: Id,
    caller: Reader,
    doors: AtDoors,
    wait: Annotated[
        float, Query(ge=0.0, le=60.0, description="Seconds to wait for a change since `If-None-Match`.")
    ] = 0.0,
    if_none_match: Annotated[
        str | None, Header(max_length=1000, description="The `ETag` of what is known already.")
    ] = None,
) -> Any:
    """Look at a job. With `If-None-Match` the answer is 304 as long as nothing has changed."""
    found = await doors.do(doors.store.jobs.get, caller.owner, job)
    if wait and _known(if_none_match, found) and found.state not in TERMINAL:
        found = await _changed(doors, found, wait)
    headers = {"ETag": _etag(found), "Cache-Control": "private, no-cache"}
    if found.state not in TERMINAL:
        headers["Retry-After"] = "1"
    if _known(if_none_match, found):
        return Response(status_code=304, headers=headers)
    return Document(job_document(found), headers=headers)


@router.post("/{job}/cancel", status_code=202, response_model=JobView)
async def cancel(job: Id, caller: Writer, doors: AtDoors) -> Any:
    """Cancel a job: at once if it waits; if it runs, within a second or so."""
    return Document(job_document(await doors.do(doors.store.jobs.cancel, caller.owner, job)), 202)


@router.post("/{job}/resume", status_code=202, response_model=JobView)
async def resume(job: Id, caller: Writer, doors: AtDoors) -> Any:
    """Have a job that failed or was cancelled go on from its last checkpoint."""
    resumed = await doors.do(doors.store.jobs.resume, caller.owner, job, doors.settings.max_active)
    return Document(job_document(resumed), 202)


@router.delete("/{job}", status_code=204)
async def delete(job: Id, caller: Writer, doors: AtDoors) -> None:
    """Delete a finished job with its result."""
    await doors.do(doors.store.jobs.delete, caller.owner, job)


@router.get("/{job}/history", response_model=HistoryPage)
async def history(
    job: Id,
    caller: Reader,
    doors: AtDoors,
    after: Annotated[
        int, Query(ge=-1, le=2**31 - 1, description="From the generation behind this one on.")
    ] = -1,
) -> Any:
    """Look at the course of a search: the error of every size and of every island over generations.

    It comes in pages: ask for what is behind the last generation of one, until a page is empty.
    """
    return await doors.do(_course, doors, caller, job, after)


async def _submitted(doors: Doors, request: JobRequest, submission: Submission) -> tuple[Job, bool]:
    before, doubts = await doors.do(_admitted, doors, request, submission)
    if before is not None:
        return before, False
    for doubt in doubts:
        with named(doors.blobs.path(doubt.dataset.blob), doubt.dataset.name) as path:
            async with doors.inspections:
                await inspected(
                    path, doubt.asked, doors.settings.inspection_memory, doors.settings.inspection_seconds
                )
    return await doors.do(doors.store.jobs.submit, submission, doors.settings.max_active)


def _admitted(
    doors: Doors, request: JobRequest, submission: Submission
) -> tuple[Job | None, tuple[Doubt, ...]]:
    """Return what is in doubt about a submission, or the job that it is already.

    That is looked for only where it spares an inspection or a refusal: what was accepted once stays so, even
    if its data set was deleted since. All others are told by `Jobs.submit`, in the transaction that accepts.
    """
    try:
        doubts = admit(request, submission.owner, doors.store, doors.settings)
    except IslandsError:
        if (before := doors.store.jobs.accepted(submission)) is not None:
            return before, ()
        raise
    return doors.store.jobs.accepted(submission) if doubts else None, doubts


def _course(doors: Doors, caller: Caller, job: str, after: int) -> Items:
    spec = doors.store.jobs.get(caller.owner, job).spec
    islands = (spec.get("settings") or {}).get("islands") or 1
    most = min(_POINTS, max(_FEWEST, _ERRORS // islands))
    names = ("generation", "evaluations", "best", "islands")
    points = doors.store.results.history(job, after, most)
    return Items([dict(zip(names, point, strict=True)) for point in points])


async def _changed(doors: Doors, job: Job, seconds: float) -> Job:
    with doors.hub.watching(job.id, job.version) as feed:
        await doors.hub.wait(feed, job.version, seconds)
    return await doors.do(doors.store.jobs.get, job.owner, job.id)


def _etag(job: Job) -> str:
    return f'"{job.version}"'


def _known(given: str | None, job: Job) -> bool:
    """Tell whether a client has a job as it is: it may send several tags, and a proxy may weaken them."""
    tags = [tag.strip().removeprefix("W/") for tag in (given or "").split(",")]
    return "*" in tags or _etag(job) in tags
