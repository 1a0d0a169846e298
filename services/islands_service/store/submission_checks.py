"""Checks inside the transaction that queues a job: idempotency key, data sets and quotas."""

import hashlib
from typing import Any

from sqlalchemy import (
    BigInteger,
    BindParameter,
    Column,
    ColumnElement,
    Connection,
    bindparam,
    func,
    select,
)

from islands.errors import SettingsError
from islands_service.domain.job import (
    ACTIVE,
    DatasetDeletedError,
    IdempotencyError,
    Job,
    JobDeletedError,
    QuotaError,
    Submission,
)
from islands_service.store.job_rows import job_from_row
from islands_service.store.tables import datasets, jobs, owners, retired_keys

# Built once, since building a statement takes as long as executing it.
_OF_OWNER: BindParameter[str] = bindparam("owner")
_OF_KEY: BindParameter[str] = bindparam("key")
_ACCEPTED = select(jobs).where(jobs.c.owner == _OF_OWNER, jobs.c.idempotency_key == _OF_KEY)
_RETIRED = select(retired_keys).where(
    retired_keys.c.owner == _OF_OWNER, retired_keys.c.idempotency_key == _OF_KEY
)


def select_quota(quota: Column[Any], default: str) -> ColumnElement[Any]:
    """Return the quota of the owner ``:owner``: its own one, or the parameter named ``default``."""
    own = select(quota).where(owners.c.name == _OF_OWNER).scalar_subquery()
    return func.coalesce(own, bindparam(default, type_=BigInteger))


_QUOTAS = (
    select(
        func.count(),
        select_quota(owners.c.max_active, "most_active"),
        select_quota(owners.c.max_islands, "most_islands"),
    )
    .select_from(jobs)
    .where(jobs.c.owner == _OF_OWNER, jobs.c.state.in_(ACTIVE))
)


def request_digest(submission: Submission) -> str:
    """Return the SHA-256 of a request, which identifies it."""
    return hashlib.sha256(submission.request.encode()).hexdigest()


def find_accepted_job(connection: Connection, submission: Submission) -> Job | None:
    """Return the job that has the idempotency key of a submission; None if there is no such job.

    Raises
    ------
    IdempotencyError
        The key belongs to a different request.
    JobDeletedError
        The job of the key was deleted.
    """
    key = submission.idempotency_key
    if key is None:
        return None
    job = connection.execute(_ACCEPTED, {"owner": submission.owner, "key": key}).one_or_none()
    if job is None:
        _check_retired_key(connection, submission, key)
        return None
    _check_request(job.id, job.request_sha256, submission, key)
    return job_from_row(job)


def _check_retired_key(connection: Connection, submission: Submission, key: str) -> None:
    retired = connection.execute(_RETIRED, {"owner": submission.owner, "key": key}).one_or_none()
    if retired is not None:
        _check_request(retired.job_id, retired.request_sha256, submission, key)
        raise JobDeletedError(
            f"the job {retired.job_id} of the idempotency key {key!r} was deleted: to run it again, take a "
            "new key"
        )


def _check_request(job: str, digest: str, submission: Submission, key: str) -> None:
    if digest != request_digest(submission):
        raise IdempotencyError(
            f"the idempotency key {key!r} belongs to job {job}, which was submitted with a different "
            "request: take a new key"
        )


def check_datasets(connection: Connection, job: Job) -> None:
    """Raise an error if a data set of a job was deleted.

    Raises
    ------
    DatasetDeletedError
    """
    query = select(datasets.c.id).where(
        datasets.c.owner == job.owner, datasets.c.id.in_(job.datasets), datasets.c.deleted.is_(None)
    )
    missing = set(job.datasets) - set(connection.execute(query).scalars())
    if missing:
        raise DatasetDeletedError(
            f"the data set {min(missing)} of job {job.id} was deleted: upload the same file again with the "
            "same options of reading, then resume the job"
        )


def check_quotas(
    connection: Connection,
    owner: str,
    most_active: int | None,
    islands: int = 0,
    most_islands: int | None = None,
) -> None:
    """Raise an error if the quotas of an owner allow no further job, or never allow this one.

    Parameters
    ----------
    most_active, most_islands : int, optional
        Quotas of active jobs and of running islands of an owner for which none were set; unlimited by
        default.
    islands : int
        Islands of a new job. An accepted job remains accepted when the quota is lowered.

    Raises
    ------
    SettingsError
        The job has more islands than all running jobs of the owner may have.
    QuotaError
        The owner has as many active jobs as its quota.
    """
    defaults = {"owner": owner, "most_active": most_active, "most_islands": most_islands}
    active, most, most_islands = connection.execute(_QUOTAS, defaults).one()
    if most_islands is not None and islands > most_islands:
        raise SettingsError(
            f"the job has {islands} islands, and your running jobs may have {most_islands} islands together: "
            "take fewer islands, or ask the operator for a larger quota"
        )
    if most is not None and active >= most:
        raise QuotaError(
            f"{active} jobs are waiting or running, and {most} is the most: wait for some, or cancel some"
        )
