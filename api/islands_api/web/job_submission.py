"""Submissions: a job of any kind is checked, accepted once, and answered with where it is."""

from typing import Annotated, Any

from fastapi import Header

from islands.errors import IslandsError
from islands_api.schemas import DiscrepancyRequest, JobRequest
from islands_api.web.auth import Principal
from islands_api.web.dependencies import AppState
from islands_api.web.problems import ResourceNotFoundError, ResultNotReadyError
from islands_api.web.responses import JSONDocument, job_document
from islands_service.domain.job import Job, JobState, Submission
from islands_service.intake.file_inspection import inspect_file
from islands_service.intake.job_inputs import link_blob
from islands_service.intake.job_validation import PendingInspection, validate_job

#: Where jobs of every kind are.
JOBS = "/v1/jobs"

#: What every answer that shows a job says beside it.
ETAG = {"description": "The job's version, for `If-None-Match`.", "schema": {"type": "string"}}
ACCEPTED: dict[int | str, dict[str, Any]] = {
    202: {
        "description": "Accepted. With `Idempotent-Replayed: true` it is the job that the key named before.",
        "headers": {
            "ETag": ETAG,
            "Location": {"description": "Where the job is.", "schema": {"type": "string"}},
            "Retry-After": {"description": "Seconds after which to look.", "schema": {"type": "string"}},
        },
    }
}

IdempotencyKey = Annotated[
    str | None,
    Header(
        min_length=1,
        max_length=255,
        description="Send the same one again to be sure: it is one job.",
    ),
]

Request = JobRequest | DiscrepancyRequest


async def submit_job(
    state: AppState, caller: Principal, request: Request, kind: str, key: str | None
) -> JSONDocument:
    """Accept a job, and say where it is.

    Raises
    ------
    IslandsError
        It could only fail, or its owner may not have it now.
    """
    submission = Submission(caller.owner, request.spec, kind, request.name, request.priority, key)
    job, new = await _submitted(state, request, submission)
    if new:
        state.metrics.accepted.inc()
    headers = {"Location": f"{JOBS}/{job.id}", "ETag": etag(job), "Retry-After": "1"}
    if not new:
        headers["Idempotent-Replayed"] = "true"
    return JSONDocument(job_document(job), 202, headers)


def etag(job: Job) -> str:
    """Return what a job is known by as it is now."""
    return f'"{job.version}"'


async def _submitted(state: AppState, request: Request, submission: Submission) -> tuple[Job, bool]:
    before, doubts = await state.run_blocking(_admitted, state, request, submission)
    if before is not None:
        return before, False
    for doubt in doubts:
        with link_blob(state.blobs.path(doubt.dataset.blob), doubt.dataset.name) as path:
            async with state.inspection_slots:
                await inspect_file(
                    path, doubt.request, state.settings.inspection_memory, state.settings.inspection_seconds
                )
    return await state.run_blocking(state.store.jobs.submit, submission, state.settings.max_active)


def _admitted(
    state: AppState, request: Request, submission: Submission
) -> tuple[Job | None, tuple[PendingInspection, ...]]:
    """Return what is in doubt about a submission, or the job that it is already.

    That is looked for only where it spares an inspection or a refusal: what was accepted once stays so, even
    if its data set was deleted since. All others are told by `Jobs.submit`, in the transaction that accepts.
    """
    try:
        doubts = validate_job(request, submission.owner, state.store, state.settings)
    except IslandsError:
        if (before := state.store.jobs.find_replay(submission)) is not None:
            return before, ()
        raise
    return state.store.jobs.find_replay(submission) if doubts else None, doubts


async def get_job_of_kind(state: AppState, caller: Principal, job: str, kind: str) -> Job:
    """Return a job that is of a kind.

    Raises
    ------
    JobNotFoundError
    ResourceNotFoundError
        It is of another kind, and has nothing of what is asked for.
    """
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    if found.kind != kind:
        raise ResourceNotFoundError(
            f"job {job} is of the kind {found.kind}, and only those of the kind {kind} have this: its "
            "/result and /report say what it found"
        )
    return found


async def get_result(state: AppState, job: Job) -> dict[str, Any]:
    """Return a job's result without its models.

    Raises
    ------
    ResultNotReadyError
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
