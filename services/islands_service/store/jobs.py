"""Operations of owners on their jobs: submit, get, list, label, cancel, stop, resume, delete.

An owner has access only to its own jobs.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from uuid import uuid4

from sqlalchemy import Connection, Row, bindparam, func, insert, select

from islands_service.domain.job import (
    ACTIVE,
    ISLANDS_VERSION,
    LABELLED,
    RESUMABLE,
    TERMINAL,
    Event,
    Job,
    JobNotFoundError,
    JobState,
    JobStateError,
    Requester,
    Submission,
    find_datasets,
)
from islands_service.store import dialect
from islands_service.store.audit import Action, record_change
from islands_service.store.database import DatabaseOperations
from islands_service.store.dialect import now
from islands_service.store.job_rows import (
    append_event,
    cancel_job,
    delete_job,
    describe_labels,
    has_tag,
    has_words,
    job_from_row,
    join_tags,
    read_document,
    update_job,
    without_note,
)
from islands_service.store.monitors import count_record
from islands_service.store.submission_checks import (
    check_datasets,
    check_quotas,
    find_accepted_job,
    request_digest,
)
from islands_service.store.tables import datasets, events, jobs, owners


@dataclass(frozen=True, slots=True)
class QueueStatistics:
    """Statistics of the jobs of all owners.

    Attributes
    ----------
    counts : mapping
        Number of jobs by state.
    oldest : float
        Seconds that the oldest queued job has waited since it was last queued.
    running : mapping
        Progress of the jobs with a valid lease, by job.
    active : mapping
        Number of queued and running jobs by owner and state.
    """

    counts: Mapping[JobState, int]
    oldest: float
    running: Mapping[str, Mapping[str, Any]]
    active: Mapping[tuple[str, JobState], int]

    @property
    def leases(self) -> int:
        """Number of jobs with a valid lease."""
        return len(self.running)


def read_queue_statistics(connection: Connection) -> QueueStatistics:
    """Return statistics of the jobs of all owners."""
    counted = select(jobs.c.state, func.count()).group_by(jobs.c.state)
    active = (
        select(jobs.c.owner, jobs.c.state, func.count())
        .where(jobs.c.state.in_(ACTIVE))
        .group_by(jobs.c.owner, jobs.c.state)
    )
    oldest = select(func.coalesce(now() - func.min(jobs.c.updated), 0.0)).where(
        jobs.c.state == JobState.QUEUED
    )
    running = select(jobs.c.id, jobs.c.progress).where(
        jobs.c.state == JobState.RUNNING, jobs.c.lease_until > now()
    )
    counts = {row[0]: row[1] for row in connection.execute(counted)}
    return QueueStatistics(
        {state: counts.get(state, 0) for state in JobState},
        connection.execute(oldest).scalar_one(),
        {row.id: read_document(row.progress) or {} for row in connection.execute(running)},
        {(row[0], JobState(row[1])): row[2] for row in connection.execute(active)},
    )


#: Largest number of jobs of a page.
MAX_PAGE_SIZE = 200

# Built once, since building a statement takes as long as executing it.
_OWNED_JOB = select(jobs).where(jobs.c.id == bindparam("id"), jobs.c.owner == bindparam("owner"))
_ANY_JOB = select(jobs).where(jobs.c.id == bindparam("id"))
_RUN_LIMIT = select(owners.c.max_run_seconds).where(owners.c.name == bindparam("of_owner")).scalar_subquery()
_DATASET_NAME = select(datasets.c.name).where(
    datasets.c.owner == bindparam("owner"), datasets.c.id == bindparam("id")
)
_INSERT_JOB = (
    insert(jobs)
    .values(
        state=JobState.QUEUED,
        created=now(),
        updated=now(),
        islands_version=ISLANDS_VERSION,
        max_run_seconds=_RUN_LIMIT,
    )
    .returning(jobs)
)


@dataclass(frozen=True, slots=True)
class JobRows:
    """A page of jobs, in the order of the list, and the position of the next page; None on the last one."""

    jobs: tuple[Job, ...]
    after: tuple[float, str] | None


class Jobs(DatabaseOperations):
    """Job operations of the store, used by the REST API on behalf of owners."""

    def submit(
        self,
        submission: Submission,
        most_active: int | None = None,
        by: Requester | None = None,
        most_islands: int | None = None,
    ) -> tuple[Job, bool]:
        """Accept a job durably; return it, and whether it is new.

        Quotas of the owner precede ``most_active`` and ``most_islands``.

        Raises
        ------
        IdempotencyError
            The key belongs to a different request.
        JobDeletedError
            The job of the key was deleted.
        QuotaError
            The owner has as many unfinished jobs as its quota.
        MonitorNotFoundError
            The owner has no such monitor.
        SettingsError
            The job has more islands than the running jobs of the owner may have together.
        StoreUnavailableError, StorageFullError
            The job was not accepted.
        """
        spec = json.dumps(submission.spec)

        def operation(connection: Connection) -> tuple[Job, bool]:
            dialect.lock_owner(connection, submission.owner)
            if (existing := find_accepted_job(connection, submission)) is not None:
                return existing, False
            check_quotas(connection, submission.owner, most_active, submission.islands, most_islands)
            monitor = submission.monitor
            number = None if monitor is None else count_record(connection, submission.owner, monitor)
            name = _find_dataset_name(connection, submission)
            tags = join_tags(submission.tags)
            values = {
                "id": uuid4().hex,
                "owner": submission.owner,
                "of_owner": submission.owner,
                "kind": submission.kind,
                "name": submission.name,
                "spec": spec,
                "request_sha256": request_digest(submission),
                "idempotency_key": submission.idempotency_key,
                "priority": submission.priority,
                "islands": submission.islands,
                "monitor_id": monitor,
                "record_number": number,
                "tags": tags,
                "dataset_name": name,
                "search_labels": describe_labels(submission.name, tags, name),
            }
            row = connection.execute(_INSERT_JOB, values).one()
            append_event(connection, row, "queued")
            record_change(connection, Action.SUBMIT, row.owner, row.id, by)
            return job_from_row(row), True

        return self._database.write(operation)

    def find_replay(self, submission: Submission) -> Job | None:
        """Return the job that has the idempotency key of a submission; None if there is no such job.

        Raises
        ------
        IdempotencyError
            The key belongs to a different request.
        JobDeletedError
            The job of the key was deleted.
        """
        with self._database.read() as connection:
            return find_accepted_job(connection, submission)

    def get(self, owner: str, job: str) -> Job:
        """Return a job.

        Raises
        ------
        JobNotFoundError
        """
        with self._database.read() as connection:
            return job_from_row(_read_owned(connection, owner, job))

    def page(
        self,
        owner: str | None,
        state: JobState | None = None,
        after: tuple[float, str] | None = None,
        limit: int = 50,
        *,
        kind: str | None = None,
        tag: str | None = None,
        words: Sequence[str] = (),
        by_error: bool = False,
    ) -> JobRows:
        """Return the jobs of an owner, or of all for None, newest first, that follow a position.

        Parameters
        ----------
        state, kind, tag : str, optional
            Only jobs that have it.
        words : sequence of str
            Only jobs that have each of these words, or parts of words, in their name, tags, name of the data
            set, equation or verdict, in any case.
        by_error : bool
            Only jobs with a model, least error first.
        """
        query = select(jobs) if owner is None else select(jobs).where(jobs.c.owner == owner)
        if state is not None:
            query = query.where(jobs.c.state == state)
        if kind is not None:
            query = query.where(jobs.c.kind == kind)
        if tag is not None:
            query = query.where(has_tag(tag))
        query = query.where(*has_words(words))
        order = jobs.c.created
        if by_error:
            query, order = query.where(jobs.c.model_error.is_not(None)), jobs.c.model_error
        rows, position = self._read_page(
            query, order, jobs.c.id, after, min(limit, MAX_PAGE_SIZE), not by_error
        )
        return JobRows(tuple(map(job_from_row, rows)), position)

    def label(
        self,
        owner: str,
        job: str,
        name: str | None = None,
        tags: Sequence[str] | None = None,
        by: Requester | None = None,
    ) -> Job:
        """Replace the name or the tags of a job in any state; what is None is kept.

        Raises
        ------
        JobNotFoundError
        """

        def operation(connection: Connection) -> Job:
            current = _read_owned(connection, owner, job, locked=True)
            new_name = current.name if name is None else name
            new_tags = current.tags if tags is None else join_tags(tags)
            if (new_name, new_tags) == (current.name, current.tags):
                return job_from_row(current)
            text = describe_labels(new_name, new_tags, current.dataset_name)
            row = update_job(connection, job, name=new_name, tags=new_tags, search_labels=text)
            append_event(connection, row, LABELLED)
            changed = job_from_row(row)
            details = json.dumps({"name": changed.name, "tags": changed.tags})
            record_change(connection, Action.LABEL, owner, job, by, details)
            return changed

        return self._database.write(operation)

    def cancel(self, owner: str | None, job: str, by: Requester | None = None) -> Job:
        """Cancel a queued job, or request cancellation of a running one; a repeated request has no effect.

        Parameters
        ----------
        owner : str or None
            Owner of the job; None for an administrator, to cancel a job of any owner.

        Raises
        ------
        JobNotFoundError
        JobStateError
            The job is finished.
        """

        def operation(connection: Connection) -> Job:
            current = _read_owned(connection, owner, job, locked=True)
            if current.state in TERMINAL:
                raise JobStateError(f"job {job} is {current.state}: there is nothing to cancel")
            if current.cancel_requested:
                return job_from_row(current)
            row = cancel_job(connection, current)
            action = Action.CANCEL if owner is not None else Action.CANCEL_AS_ADMINISTRATOR
            record_change(connection, action, row.owner, job, by)
            return job_from_row(row)

        return self._database.write(operation, urgent=True)

    def stop(self, owner: str, job: str, by: Requester | None = None) -> Job:
        """Request that the search of a job ends with its best models; a repeated request has no effect.

        Raises
        ------
        JobNotFoundError
        JobStateError
            The job is finished, is being cancelled, has not begun, or has no search.
        """

        def operation(connection: Connection) -> Job:
            current = _read_owned(connection, owner, job, locked=True)
            found = job_from_row(current)
            _check_stoppable(found)
            if found.stop_requested:
                return found
            row = update_job(connection, job, stop_requested=True)
            append_event(connection, row, "stopping")
            record_change(connection, Action.STOP, owner, job, by)
            return job_from_row(row)

        return self._database.write(operation)

    def resume(
        self, owner: str, job: str, most_active: int | None = None, by: Requester | None = None
    ) -> Job:
        """Queue a failed or cancelled job again, to continue from its last checkpoint.

        Raises
        ------
        JobNotFoundError
        JobStateError
            The job is queued or running, or has succeeded.
        DatasetDeletedError
            A data set of the job was deleted.
        QuotaError
            See `submit`.
        """

        def operation(connection: Connection) -> Job:
            dialect.lock_owner(connection, owner)
            current = _read_owned(connection, owner, job, locked=True)
            if current.state not in RESUMABLE:
                raise JobStateError(
                    f"job {job} is {current.state}: only a failed or cancelled job can be resumed"
                )
            check_datasets(connection, job_from_row(current))
            check_quotas(connection, owner, most_active)
            row = update_job(
                connection,
                job,
                state=JobState.QUEUED,
                cancel_requested=False,
                stop_requested=False,
                stalled=0,
                not_before=0.0,
                run_seconds=0.0,
                problem=None,
                finished=None,
                progress=without_note(current.progress),
            )
            append_event(connection, row, "queued")
            record_change(connection, Action.RESUME, owner, job, by)
            return job_from_row(row)

        return self._database.write(operation)

    def delete(self, owner: str, job: str, by: Requester | None = None) -> None:
        """Delete a finished job with its events, history, result and artefacts; keep its idempotency key.

        Raises
        ------
        JobNotFoundError
        JobStateError
            The job is not finished.
        """

        def operation(connection: Connection) -> None:
            current = _read_owned(connection, owner, job, locked=True)
            if current.state not in TERMINAL:
                raise JobStateError(f"job {job} is {current.state}: cancel it first")
            delete_job(connection, current)
            record_change(connection, Action.DELETE, owner, job, by)

        self._database.write(operation, urgent=True)

    def versions(self, of: Sequence[str]) -> dict[str, int]:
        """Return the versions of jobs. One query finds the changes for all watching clients."""
        with self._database.read() as connection:
            query = select(jobs.c.id, jobs.c.version).where(jobs.c.id.in_(of))
            return {row.id: row.version for row in connection.execute(query)}

    def events(self, job: str, after: int = 0) -> tuple[Event, ...]:
        """Return the events of a job after a number, in order."""
        with self._database.read() as connection:
            rows = connection.execute(
                select(events)
                .where(events.c.job_id == job, events.c.number > after)
                .order_by(events.c.number)
            )
            return tuple(
                Event(row.job_id, row.number, row.kind, json.loads(row.data), row.at) for row in rows
            )

    def queue_statistics(self) -> QueueStatistics:
        """Return statistics of the jobs of all owners."""
        with self._database.read() as connection:
            return read_queue_statistics(connection)


def _find_dataset_name(connection: Connection, submission: Submission) -> str | None:
    """Return the name of the first data set of a job."""
    found = find_datasets(submission.spec)
    if not found:
        return None
    name: str | None = connection.execute(_DATASET_NAME, {"owner": submission.owner, "id": found[0]}).scalar()
    return name


def _check_stoppable(job: Job) -> None:
    """Raise an error if a job has no search that could end early with models.

    Raises
    ------
    JobStateError
    """
    if job.state in TERMINAL:
        raise JobStateError(f"job {job.id} is {job.state}: there is no search to stop")
    if not job.has_search:
        raise JobStateError(f"job {job.id} has no search to stop: wait for its end, or cancel it")
    if job.cancel_requested:
        raise JobStateError(f"job {job.id} is being cancelled, and keeps the models found so far")
    if job.state == JobState.QUEUED and job.checkpoint is None:
        raise JobStateError(f"job {job.id} is queued: it has no models yet, wait for its start, or cancel it")


def _read_owned(connection: Connection, owner: str | None, job: str, locked: bool = False) -> Row[Any]:
    """Return the row of a job of an owner, or of any owner for None."""
    query = _OWNED_JOB if owner is not None else _ANY_JOB
    query = query.with_for_update() if locked else query
    row = connection.execute(
        query, {"id": job} if owner is None else {"id": job, "owner": owner}
    ).one_or_none()
    if row is None:
        raise JobNotFoundError(f"there is no job {job!r}")
    return row
