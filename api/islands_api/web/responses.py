"""JSON documents of jobs and other resources, written by hand for speed: clients poll jobs very often."""

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from math import inf, isfinite
from time import monotonic, time
from typing import Any

from starlette.responses import JSONResponse

from islands_api.schemas import ResponseModel
from islands_service.domain.job import TERMINAL, WAITING_PHASE, Job, JobState, find_seconds_left
from islands_service.domain.owner import Owner
from islands_service.store.datasets import StoredDataset
from islands_service.store.fair_queue import QueuePlace

#: Parts of the progress that are valid only while a job runs.
_OF_ATTEMPTS = ("phase", "note", "seconds_left", "evaluations_per_second", "free_run")

#: Types of the fields of views that are seconds since 1970 in the values.
_TIMES = (datetime, datetime | None)

#: Seconds for which the place of a queued job is kept.
_PLACE_SECONDS = 1.0

#: Largest number of jobs whose place is kept.
_MAX_PLACES = 10_000


def job_document(job: Job, max_run_seconds: int, place: QueuePlace | None = None) -> dict[str, Any]:
    """Convert a job to a document with the fields of `islands_api.schemas.JobView`.

    Parameters
    ----------
    max_run_seconds : int
        Limit of the run time of jobs whose owner has no such quota.
    place : QueuePlace, optional
        Place of a queued job, if it is known.
    """
    progress = _select_progress(job)
    if progress is not None and place is not None:
        known = {"note": place.note or None, "seconds_to_start": place.seconds_to_start}
        progress |= {"position": place.position}
        progress |= {name: value for name, value in known.items() if value is not None}
    return {
        "id": job.id,
        "kind": job.kind,
        "name": job.name,
        "tags": job.tags,
        "dataset_name": job.dataset_name,
        "state": job.state,
        "priority": job.priority,
        "version": job.version,
        "attempt": job.attempt,
        "cancel_requested": job.cancel_requested,
        "stop_requested": job.stop_requested,
        "created": _format_time(job.created),
        "updated": _format_time(job.updated),
        "started": _format_time(job.started),
        "finished": _format_time(job.finished),
        "run_seconds": round(job.run_seconds, 1),
        "max_run_seconds": max_run_seconds if job.max_run_seconds is None else job.max_run_seconds,
        "spec": job.spec,
        "progress": progress,
        "summary": job.summary,
        "problem": job.problem,
        "versions": job.versions,
    }


def _select_progress(job: Job) -> dict[str, Any] | None:
    """Return the progress of a job without what its last attempt reported about the time before its end.

    The phase of a job that does not run is its state.
    """
    if job.state == JobState.RUNNING:
        return None if job.progress is None else _count_down(dict(job.progress), job.updated)
    reached = {name: value for name, value in (job.progress or {}).items() if name not in _OF_ATTEMPTS}
    # The store gives the reason why a job has to wait for its next attempt.
    if job.state == JobState.QUEUED and (job.progress or {}).get("phase") == WAITING_PHASE:
        reached |= {name: value for name, value in (job.progress or {}).items() if name == "note"}
    if job.state in TERMINAL and job.progress is None:
        return None
    return {**reached, "phase": job.state}


def _count_down(progress: dict[str, Any], reported: float) -> dict[str, Any]:
    """Subtract the time since the last report from the time left."""
    if progress.get("seconds_left") is not None:
        progress["seconds_left"] = find_seconds_left(progress, reported, time())
    return progress


class QueuePlaces:
    """Cache of the places of queued jobs, for a second: clients poll more often than jobs move."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[float, QueuePlace | None]] = {}

    def find(self, jobs: Sequence[Job]) -> tuple[dict[str, QueuePlace], list[Job]]:
        """Return the known places of jobs, and the queued ones whose place has to be read."""
        now = monotonic()
        queued = [job for job in jobs if job.state == JobState.QUEUED]
        known = {job.id: self._known.get(job.id, (-inf, None)) for job in queued}
        fresh = {job: place for job, (at, place) in known.items() if now - at < _PLACE_SECONDS}
        places = {job: place for job, place in fresh.items() if place is not None}
        return places, [job for job in queued if job.id not in fresh]

    def store(self, jobs: Sequence[Job], places: Mapping[str, QueuePlace]) -> None:
        """Store the places of jobs that were read now."""
        now = monotonic()
        if len(self._known) > _MAX_PLACES:
            self._known.clear()
        for job in jobs:
            self._known[job.id] = now, places.get(job.id)


def dataset_document(dataset: StoredDataset, retention: int = 0) -> dict[str, Any]:
    """Convert a data set to a document with the fields of `islands_api.dataset_schemas.DatasetView`.

    Parameters
    ----------
    retention : int
        Seconds for which the owner's data sets without jobs are kept; 0 for ever.
    """
    since = dataset.idle_since if retention else None
    return {
        "id": dataset.id,
        "name": dataset.name,
        "sha256": dataset.blob,
        "bytes": dataset.bytes,
        "created": _format_time(dataset.created),
        "source": dataset.source,
        "expires": _format_time(None if since is None else since + retention),
        "preview": dataset.preview,
    }


def dataset_summary(dataset: StoredDataset, retention: int = 0) -> dict[str, Any]:
    """Convert a data set of a page to a document: `islands_api.dataset_schemas.DatasetSummary`."""
    document = dataset_document(dataset, retention)
    summary = document.pop("preview")
    return {**document, **summary}


def view_document(value: object, view: type[ResponseModel]) -> dict[str, Any]:
    """Convert a value to a document with the fields of a view, which are attributes of the value."""
    given = {name: getattr(value, name) for name in view.model_fields}
    times = (name for name, field in view.model_fields.items() if field.annotation in _TIMES)
    sets = {name: sorted(each) for name, each in given.items() if isinstance(each, frozenset)}
    return {**given, **sets, **{name: _format_time(given[name]) for name in times}}


def owner_document(owner: Owner) -> dict[str, Any]:
    """Convert an owner to a document with the fields of `islands_api.admin_schemas.OwnerView`."""
    return {
        "name": owner.name,
        "weight": owner.weight,
        **owner.quotas,
        "queued": owner.queued,
        "running": owner.running,
        "running_islands": owner.running_islands,
        "stored": owner.stored,
    }


class JSONDocument(JSONResponse):
    """JSON response without validation by a schema."""

    def render(self, content: Any) -> bytes:
        """Serialise the document."""
        return json_text(content).encode()


class JSONItems(JSONDocument):
    """JSON response with a long list of items.

    The items are serialised one by one, so that other threads can run in between.
    """

    def render(self, content: Any) -> bytes:
        """Serialise the items."""
        return b'{"items":[' + b",".join(json_text(item).encode() for item in content) + b"]}"


def json_text(content: Any) -> str:
    """Serialise to JSON; NaN and infinity, for example an infinite error, become null."""
    try:
        return json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    except ValueError:
        return json_text(_replace_nonfinite(content))


def _replace_nonfinite(content: Any) -> Any:
    if isinstance(content, dict):
        return {name: _replace_nonfinite(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return [_replace_nonfinite(value) for value in content]
    return None if isinstance(content, float) and not isfinite(content) else content


def _format_time(seconds: float | None) -> str | None:
    if seconds is None:
        return None
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
