"""Checks of a submission inside the transaction that stores it: idempotency key and quota."""

import hashlib

from sqlalchemy import Connection, func, select

from islands_service.domain.job import ACTIVE, IdempotencyError, Job, QuotaError, Submission
from islands_service.store.job_events import job_from_row
from islands_service.store.tables import jobs


def request_digest(submission: Submission) -> str:
    """Return the SHA-256 of a request, which identifies it."""
    return hashlib.sha256(submission.request.encode()).hexdigest()


def find_accepted_job(connection: Connection, submission: Submission) -> Job | None:
    """Return the job that has the idempotency key of a submission; None if there is no such job.

    Raises
    ------
    IdempotencyError
        The key belongs to a different request.
    """
    key = submission.idempotency_key
    if key is None:
        return None
    query = select(jobs).where(jobs.c.owner == submission.owner, jobs.c.idempotency_key == key)
    job = connection.execute(query).one_or_none()
    if job is None:
        return None
    if job.request_sha256 != request_digest(submission):
        raise IdempotencyError(
            f"the idempotency key {key!r} belongs to job {job.id}, which was submitted with a different "
            "request: take a new key"
        )
    return job_from_row(job)


def check_quota(connection: Connection, owner: str, most: int) -> None:
    """Raise an error if an owner already has ``most`` active jobs.

    Raises
    ------
    QuotaError
    """
    active = connection.execute(
        select(func.count()).select_from(jobs).where(jobs.c.owner == owner, jobs.c.state.in_(ACTIVE))
    ).scalar_one()
    if active >= most:
        raise QuotaError(
            f"{active} jobs are waiting or running, and {most} is the most: wait for some, or cancel some"
        )
