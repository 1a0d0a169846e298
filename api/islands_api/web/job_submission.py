"""Job submission, and lookup of jobs and results, for all kinds of jobs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any

from fastapi import Header

from islands.errors import IslandsError
from islands_api.schemas import DiscrepancyRequest, JobRequest
from islands_api.web.auth import Principal
from islands_api.web.dependencies import AppState
from islands_api.web.problems import ResourceNotFoundError, ResultNotReadyError
from islands_api.web.responses import JSONDocument, job_document
from islands_api.web.uploads import open_stored
from islands_service.domain.job import Job, JobState, Requester, Submission
from islands_service.domain.job_spec import Discrepancy, Identification
from islands_service.intake.file_inspection import inspect_file
from islands_service.intake.job_validation import ValidJob, validate_job

#: Path of jobs of every kind.
JOBS_PATH = "/v1/jobs"

#: Documented header of every response that contains a job.
ETAG = {"description": "The job's version, for `If-None-Match`.", "schema": {"type": "string"}}

#: Documented responses of the routes that submit a job.
ACCEPTED_RESPONSES: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "Accepted. With `Idempotent-Replayed: true`, the job of an earlier, equal request.",
        "headers": {
            "ETag": ETAG,
            "Location": {"description": "Path of the job.", "schema": {"type": "string"}},
            "Retry-After": {"description": "Seconds until the next poll.", "schema": {"type": "string"}},
        },
    }
}

IdempotencyKey = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=255,
        description="A repeated request with the same key creates no second job.",
    ),
]


async def submit_job(
    state: AppState, caller: Principal, request: JobRequest | DiscrepancyRequest, kind: str, key: str | None
) -> JSONDocument:
    """Validate a job, store it once and return it.

    Raises
    ------
    IslandsError
        The job could only fail, or its owner has used up a quota.
    """
    submission = Submission(
        caller.owner,
        request.spec,
        kind,
        request.name,
        request.priority,
        key,
        tags=tuple(dict.fromkeys(request.tags)),
    )
    return await accept_job(state, caller, request, submission)


async def accept_job(
    state: AppState, caller: Principal, reading: Identification | Discrepancy, submission: Submission
) -> JSONDocument:
    """Validate and store a job as `submit_job` does, given the records that it reads.

    Raises
    ------
    IslandsError
    """
    job, new = await _validate_and_store(state, reading, submission, caller.requester)
    if new:
        state.metrics.accepted.inc()
    headers = {
        "Location": f"{state.settings.root_path}{JOBS_PATH}/{job.id}",
        "ETag": etag(job),
        "Retry-After": "1",
    }
    if not new:
        headers["Idempotent-Replayed"] = "true"
    # Without the position, since the time to find it is proportional to the length of the queue.
    return JSONDocument(job_document(job, state.settings.max_run_seconds), 202, headers)


async def describe_job(state: AppState, job: Job) -> dict[str, Any]:
    """Return the document of a job, with its place if it is queued."""
    (document,) = await describe_jobs(state, (job,))
    return document


async def describe_jobs(state: AppState, jobs: Sequence[Job]) -> list[dict[str, Any]]:
    """Return the documents of jobs, with the places of those that are queued."""
    places, unknown = state.places.find(jobs)
    if unknown:
        quotas = state.settings.max_running, state.settings.max_running_islands
        found = await state.run_blocking(state.store.leases.queue_places, unknown, *quotas)
        state.places.store(unknown, found)
        places |= found
    return [job_document(job, state.settings.max_run_seconds, places.get(job.id)) for job in jobs]


def etag(job: Job) -> str:
    """Return the entity tag of a job: its version."""
    return f'"{job.version}"'


async def _validate_and_store(
    state: AppState, reading: Identification | Discrepancy, submission: Submission, by: Requester
) -> tuple[Job, bool]:
    """Return a stored job, and whether it is new."""
    found = await state.run_blocking(_store_if_valid, state, reading, submission, by)
    if isinstance(found, tuple):
        return found
    for inspection in found.inspections:
        async with open_stored(state, submission.owner, inspection.dataset) as path:
            await inspect_file(
                path,
                inspection.request,
                state.settings.inspection_memory,
                state.settings.inspection_seconds,
            )
    return await state.run_blocking(_store, state, submission, found, by)


def _store_if_valid(
    state: AppState, reading: Identification | Discrepancy, submission: Submission, by: Requester
) -> tuple[Job, bool] | ValidJob:
    """Store a job and return it, and whether it is new, unless files must be inspected before.

    One call does everything, since a change of the thread takes as long as a query.
    """
    found = _validate_or_replay(state, reading, submission)
    if isinstance(found, Job):
        return found, False
    return found if found.inspections else _store(state, submission, found, by)


def _store(state: AppState, submission: Submission, valid: ValidJob, by: Requester) -> tuple[Job, bool]:
    settings, submission = state.settings, replace(submission, islands=valid.islands)
    return state.store.jobs.submit(submission, settings.max_active, by, settings.max_running_islands)


def _validate_or_replay(
    state: AppState, reading: Identification | Discrepancy, submission: Submission
) -> Job | ValidJob:
    """Return the job that an earlier request with the same key created, or what the validation found.

    The earlier job is looked up only if it saves an inspection or a rejection: an accepted job stays
    accepted, even if its data set has been deleted since. In all other cases `Jobs.submit` finds it, in the
    transaction that stores the job.
    """
    try:
        valid = validate_job(reading, submission.owner, state.store, state.settings)
    except IslandsError:
        if (replayed := state.store.jobs.find_replay(submission)) is not None:
            return replayed
        raise
    return (state.store.jobs.find_replay(submission) if valid.inspections else None) or valid


async def get_job_of_kind(state: AppState, caller: Principal, job: str, kind: str) -> Job:
    """Return a job of a certain kind.

    Raises
    ------
    JobNotFoundError
    ResourceNotFoundError
        The job is of another kind.
    """
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    if found.kind != kind:
        raise ResourceNotFoundError(
            f"job {job} is of the kind {found.kind}, but only jobs of the kind {kind} have this resource: "
            "see its /result and /report"
        )
    return found


async def get_result(state: AppState, job: Job) -> dict[str, Any]:
    """Return the result of a job without its models.

    Raises
    ------
    ResultNotReadyError
        The job has not succeeded.
    """
    document = await state.run_blocking(state.store.results.document, job.id)
    if document is None:
        hint = (
            "wait until it has succeeded"
            if job.state in (JobState.QUEUED, JobState.RUNNING)
            else "resume it, or submit it again"
        )
        raise ResultNotReadyError(f"job {job.id} is {job.state} and has no result: {hint}")
    return document
