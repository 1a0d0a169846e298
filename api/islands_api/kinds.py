"""Kinds of jobs, as routes meet them: each has a result and a report, and some have more."""

from typing import Any

from islands_api.auth import Caller
from islands_api.doors import Doors
from islands_api.problems import NoSuchThing, NotFinished
from islands_service.jobs import Job, JobState


async def of_kind(doors: Doors, caller: Caller, job: str, kind: str) -> Job:
    """Return a job that is of a kind.

    Raises
    ------
    NoSuchJob
    NoSuchThing
        It is of another kind, and has nothing of what is asked for.
    """
    found = await doors.do(doors.store.jobs.get, caller.owner, job)
    if found.kind != kind:
        raise NoSuchThing(
            f"job {job} is of the kind {found.kind}, and only those of the kind {kind} have this: its "
            "/result and /report say what it found"
        )
    return found


async def finished(doors: Doors, job: Job) -> dict[str, Any]:
    """Return a job's result without its models.

    Raises
    ------
    NotFinished
    """
    document = await doors.do(doors.store.results.document, job.id)
    if document is None:
        hint = (
            "wait until it has succeeded"
            if job.state in (JobState.QUEUED, JobState.RUNNING)
            else "resume it, or submit it again"
        )
        raise NotFinished(f"job {job.id} is {job.state} and has no result: {hint}")
    return document
