"""Checks of a submission inside the transaction that stores it: idempotency key and quota."""

import hashlib

from sqlalchemy import Connection, func, select

from islands_service.domain.job import ACTIVE, IdempotencyError, Job, QuotaError, Submission
from islands_service.store.job_events import job_from_row
from islands_service.store.tables import jobs


def request_digest(submission: Submission) -> str:
    """Return what tells one request from another."""
    return hashlib.sha256(submission.request.encode()).hexdigest()


def find_accepted_job(connection: Connection, submission: Submission) -> Job | None:
    """Return the job that a submission's idempotency key names already, None where it names none.

    Raises
    ------
    IdempotencyError
        The key was used with another request.
    """
    key = submission.idempotency_key
    if key is None:
        return None
    query = select(jobs).where(jobs.c.owner == submission.owner, jobs.c.idempotency_key == key)
    before = connection.execute(query).one_or_none()
    if before is None:
        return None
    if before.request_sha256 != request_digest(submission):
        raise IdempotencyError(
            f"the idempotency key {key!r} belongs to job {before.id}, which was asked for with another "
            "request: take a new key"
        )
    return job_from_row(before)


def check_quota(connection: Connection, owner: str, most: int) -> None:
    """Refuse one more job of an owner who has so many.

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
