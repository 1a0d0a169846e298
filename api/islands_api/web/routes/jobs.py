"""Jobs: submit, list, get, wait, label, cancel, stop, resume, delete, history, free run of the search."""

from functools import partial
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response

from islands.errors import SettingsError
from islands_api.result_schemas import SearchFreeRunView
from islands_api.schemas import (
    LINE,
    TAG_PATTERN,
    HistoryPage,
    JobLabels,
    JobPage,
    JobRequest,
    JobView,
)
from islands_api.web.auth import Reader, Writer
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import (
    ACCEPTED_RESPONSES,
    ETAG,
    IdempotencyKey,
    describe_job,
    describe_jobs,
    etag,
    get_job_of_kind,
    submit_job,
)
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.requests import (
    REVALIDATE,
    Cursor,
    IfNoneMatch,
    JSONRoute,
    Limit,
    decode_cursor,
    encode_cursor,
    matches_etag,
)
from islands_api.web.responses import JSONDocument, JSONItems, job_document
from islands_service.domain.job import (
    IDENTIFICATION,
    KINDS,
    MAX_TAG_LENGTH,
    SEARCH_FREE_RUN,
    TERMINAL,
    Job,
    JobState,
)

router = APIRouter(prefix="/v1/jobs", tags=["jobs"], responses=RESPONSES, route_class=JSONRoute)

#: Path parameter: the id of a job.
Id = Annotated[
    str,
    Path(
        pattern=r"^[0-9A-Za-z_-]{1,64}$",
        description="A job's `id`.",
        examples=["0b8f6c1f3d0e4b6f9a3f5a0d1c2b3a4e"],
    ),
]

_JOB_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"headers": {"ETag": ETAG}},
    304: {"description": "Not changed.", "headers": {"ETag": ETAG}},
}

#: Maximum number of points of a page of the history.
_MAX_POINTS = 5000

#: Minimum number of points of a page of the history, whatever the number of islands.
_MIN_POINTS = 50

#: Maximum number of island errors of a page: a larger page would block other requests for seconds.
_MAX_ISLAND_ERRORS = 100_000


#: Maximum number of words of a search: each is looked for in every job.
_MAX_WORDS = 10

#: Query parameter of lists of jobs.
StateFilter = Annotated[JobState | None, Query(alias="state", description="Only jobs in this state.")]


@router.post("", status_code=202, response_model=JobView, responses=ACCEPTED_RESPONSES)
async def submit(
    request: JobRequest, caller: Writer, state: AppStateDep, idempotency_key: IdempotencyKey = None
) -> Any:
    """Submit a job that identifies a record. A job accepted with 202 is stored durably.

    The job is queued until a coordinator is free. Follow it by its `events`, or by `GET` with `wait`.
    """
    return await submit_job(state, caller, request, IDENTIFICATION, idempotency_key)


@router.get("", response_model=JobPage)
async def jobs(
    caller: Reader,
    state: AppStateDep,
    job_state: StateFilter = None,
    kind: Annotated[
        str | None,
        Query(pattern=f"^({'|'.join(KINDS)})$", description=f"Only jobs of this kind: {', '.join(KINDS)}."),
    ] = None,
    tag: Annotated[
        str | None,
        Query(max_length=MAX_TAG_LENGTH, pattern=TAG_PATTERN, description="Only jobs with this tag."),
    ] = None,
    q: Annotated[
        str,
        Query(
            max_length=200,
            pattern=rf"^{LINE}*$",
            description="Only jobs with each of these words, or parts of words, in their name, tags, name of "
            "the data set, equation or verdict, in any case.",
        ),
    ] = "",
    sort: Annotated[
        str,
        Query(
            pattern="^(created|error)$",
            description="`created`: newest first. `error`: only jobs with a model, by its mean error in "
            "per cent of the range of the output, least first.",
        ),
    ] = "created",
    cursor: Cursor = None,
    limit: Limit = 50,
) -> Any:
    """List jobs of all kinds, newest first."""
    words = q.split()
    if len(words) > _MAX_WORDS:
        raise SettingsError(f"q has {len(words)} words, and {_MAX_WORDS} is the most: take fewer")
    read_page = partial(state.store.jobs.page, kind=kind, tag=tag, words=words, by_error=sort == "error")
    page = await state.run_blocking(read_page, caller.owner, job_state, decode_cursor(cursor), limit)
    items = await describe_jobs(state, page.jobs)
    return JSONDocument({"items": items, "next": encode_cursor(page.after)})


@router.get("/{job}", response_model=JobView, responses=_JOB_RESPONSES)
async def job(
    job: Id,
    caller: Reader,
    state: AppStateDep,
    wait: Annotated[
        float, Query(ge=0.0, le=60.0, description="Seconds to wait for a change since `If-None-Match`.")
    ] = 0.0,
    if_none_match: IfNoneMatch = None,
) -> Any:
    """Return a job. With `If-None-Match`, the status is 304 if the job has not changed.

    `progress.position` of a queued job changes with other jobs: read it without `If-None-Match`.
    """
    current = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    if wait and matches_etag(if_none_match, etag(current)) and current.state not in TERMINAL:
        current = await _wait_for_change(state, current, wait)
    headers = {"ETag": etag(current), "Cache-Control": REVALIDATE}
    if current.state not in TERMINAL:
        headers["Retry-After"] = "1"
    if matches_etag(if_none_match, etag(current)):
        return Response(status_code=304, headers=headers)
    return JSONDocument(await describe_job(state, current), headers=headers)


@router.patch("/{job}", response_model=JobView, responses={200: {"headers": {"ETag": ETAG}}})
async def label(job: Id, labels: JobLabels, caller: Writer, state: AppStateDep) -> Any:
    """Change the name or the tags of a job in any state. They have no effect on its result."""
    changed = await state.run_blocking(
        state.store.jobs.label, caller.owner, job, labels.name, labels.tags, caller.requester
    )
    return JSONDocument(await describe_job(state, changed), headers={"ETag": etag(changed)})


@router.post("/{job}/cancel", status_code=202, response_model=JobView)
async def cancel(job: Id, caller: Writer, state: AppStateDep) -> Any:
    """Cancel a job: a queued one immediately, a running one within about a second."""
    cancelled = await state.run_blocking(state.store.jobs.cancel, caller.owner, job, caller.requester)
    return JSONDocument(job_document(cancelled, state.settings.max_run_seconds), 202)


@router.post("/{job}/stop", status_code=202, response_model=JobView)
async def stop(job: Id, caller: Writer, state: AppStateDep) -> Any:
    """Stop the search of a running identification: the job succeeds with the best models found so far.

    The search ends with its present epoch, and not before its first population. The best models are
    estimated and validated as after a complete search. `summary.ended_by` is `stopped by its owner`, and the
    note of the summary names the last generation.
    """
    stopped = await state.run_blocking(state.store.jobs.stop, caller.owner, job, caller.requester)
    return JSONDocument(job_document(stopped, state.settings.max_run_seconds), 202)


@router.post("/{job}/resume", status_code=202, response_model=JobView)
async def resume(job: Id, caller: Writer, state: AppStateDep) -> Any:
    """Resume a failed or cancelled job from its last checkpoint. Its data sets must exist."""
    resumed = await state.run_blocking(
        state.store.jobs.resume, caller.owner, job, state.settings.max_active, caller.requester
    )
    return JSONDocument(await describe_job(state, resumed), 202)


@router.delete("/{job}", status_code=204)
async def delete(job: Id, caller: Writer, state: AppStateDep) -> None:
    """Delete a finished job with its result. Its idempotency key creates no new job."""
    await state.run_blocking(state.store.jobs.delete, caller.owner, job, caller.requester)


@router.get("/{job}/history", response_model=HistoryPage)
async def history(
    job: Id,
    caller: Reader,
    state: AppStateDep,
    after: Annotated[
        int, Query(ge=-1, le=2**31 - 1, description="Return only generations after this one.")
    ] = -1,
) -> Any:
    """Return the convergence of a search: the error of each model size and of each island by generation.

    The history has pages: repeat the request with `after` set to the last generation until a page is empty.
    """
    found = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    return await state.run_blocking(_read_history, state, found, after)


@router.get("/{job}/free-run", response_model=SearchFreeRunView)
async def free_run(job: Id, caller: Reader, state: AppStateDep) -> Response:
    """Return the free run of the best model so far of a running search, with the measured output.

    `progress.free_run` of the job changes with it. A finished job has the free runs of its models.
    """
    found = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    blob = await state.run_blocking(state.store.results.artefact, job, SEARCH_FREE_RUN)
    if blob is None:
        hint = "wait until its progress has free_run"
        if found.state == JobState.SUCCEEDED:
            hint = "see the /simulation of its /models"
        elif not found.has_search:
            hint = "its models are fitted without a search"
        raise ResourceNotFoundError(f"job {job} is {found.state} and has no free run of a search: {hint}")
    return Response(await state.run_blocking(state.blobs.read, blob), media_type="application/json")


def _read_history(state: AppState, job: Job, after: int) -> JSONItems:
    islands = (job.spec.get("settings") or {}).get("islands") or 1
    limit = min(_MAX_POINTS, max(_MIN_POINTS, _MAX_ISLAND_ERRORS // islands))
    names = ("generation", "evaluations", "best", "islands")
    points = state.store.results.history(job.id, after, limit)
    return JSONItems([dict(zip(names, point, strict=True)) for point in points])


async def _wait_for_change(state: AppState, job: Job, seconds: float) -> Job:
    with state.hub.subscribe(job.id, job.version) as feed:
        await state.hub.wait(feed, job.version, seconds)
    return await state.run_blocking(state.store.jobs.get, job.owner, job.id)
