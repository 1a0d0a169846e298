"""From what the store knows to what goes over the wire, by hand: some ask a thousand times a second."""

import json
from datetime import UTC, datetime
from math import isfinite
from typing import Any

from starlette.responses import JSONResponse

from islands_service.domain.job import Job
from islands_service.store.datasets import StoredDataset


def job_document(job: Job) -> dict[str, Any]:
    """Return a job as it goes over the wire: `islands_api.schemas.JobView`."""
    return {
        "id": job.id,
        "kind": job.kind,
        "name": job.name,
        "state": job.state,
        "priority": job.priority,
        "version": job.version,
        "attempt": job.attempt,
        "cancel_requested": job.cancel_requested,
        "created": _time(job.created),
        "updated": _time(job.updated),
        "started": _time(job.started),
        "finished": _time(job.finished),
        "spec": job.spec,
        "progress": job.progress,
        "summary": job.summary,
        "problem": job.problem,
    }


def dataset_document(dataset: StoredDataset) -> dict[str, Any]:
    """Return a data set as it goes over the wire: `islands_api.schemas.DatasetView`."""
    return {
        "id": dataset.id,
        "name": dataset.name,
        "sha256": dataset.blob,
        "bytes": dataset.bytes,
        "created": _time(dataset.created),
        "preview": dataset.preview,
    }


class JSONDocument(JSONResponse):
    """An answer that is made by hand."""

    def render(self, content: Any) -> bytes:
        """Write it as JSON."""
        return json_text(content).encode()


class JSONItems(JSONDocument):
    """A list of things, perhaps long: made in a thread, it lets others go on between two of them."""

    def render(self, content: Any) -> bytes:
        """Write it as JSON."""
        return b'{"items":[' + b",".join(json_text(each).encode() for each in content) + b"]}"


def json_text(content: Any) -> str:
    """Write JSON; a number that JSON does not have, such as an infinite error, is null."""
    try:
        return json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    except ValueError:
        return json_text(_finite(content))


def _finite(content: Any) -> Any:
    if isinstance(content, dict):
        return {name: _finite(value) for name, value in content.items()}
    if isinstance(content, list | tuple):
        return [_finite(value) for value in content]
    return None if isinstance(content, float) and not isfinite(content) else content


def _time(seconds: float | None) -> str | None:
    if seconds is None:
        return None
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
