"""Response documents: they have the fields of their schemas and are valid JSON for any content."""

import json
import math
from dataclasses import replace
from datetime import datetime

import pytest

from islands_api.schemas import JobView
from islands_api.web import responses
from islands_api.web.responses import job_document, json_text
from islands_service.domain.job import Job, JobState
from support.service import kept, queued, spec
from support.stores import taken


@pytest.mark.parametrize("number", [math.inf, -math.inf, math.nan])
def test_numbers_that_json_lacks_are_null(number):
    assert json.loads(json_text({"a": (1.0, number), "b": number})) == {"a": [1.0, None], "b": None}


def test_a_job_document_with_all_values_round_trips_through_its_schema():
    job = Job(
        id="a",
        owner="me",
        kind="identification",
        name="piezo",
        spec={"dataset": "b"},
        priority=-3,
        state=JobState.FAILED,
        version=9,
        attempt=2,
        cancel_requested=True,
        stop_requested=True,
        progress={"generation": 7, "phase": JobState.FAILED},
        checkpoint="c",
        summary={"equation": "y(k) = 0"},
        problem={"title": "failed"},
        run_seconds=2.5,
        max_run_seconds=7200,
        created=1.5,
        updated=4.125,
        started=2.25,
        finished=4.0,
        versions={"job": "1.2", "checkpoint": None, "result": "1.3"},
    )
    view = JobView.model_validate_json(json_text(job_document(job, 3600)))
    assert view.model_extra == {}
    for field in JobView.model_fields:
        value = getattr(view, field)
        assert (value.timestamp() if isinstance(value, datetime) else value) == getattr(job, field)


#: Progress of a search that waits for CPUs.
WAITING = {
    "phase": "waiting for capacity",
    "note": "waiting for capacity: 0 of 1 island actors are ready",
    "seconds_left": 12.0,
    "evaluations_per_second": 3.0,
    "generation": 4,
}


@pytest.mark.parametrize("state", JobState)
def test_the_progress_of_a_job_that_does_not_run_has_only_reached_values(service, monkeypatch, state):
    job = replace(queued(service.store), state=state, progress=WAITING)
    monkeypatch.setattr(responses, "time", lambda: job.updated)
    reached = WAITING if state == JobState.RUNNING else {"phase": state, "generation": 4}
    assert job_document(job, 3600)["progress"] == reached


def test_a_queued_job_has_the_reason_of_its_wait_until_it_ends(service):
    lease = claimed_job(service)
    service.store.leases.postpone(lease, "the disk is full", 60.0)
    job = service.store.jobs.get("local", lease.job.id)
    assert job_document(job, 3600)["progress"] == {"phase": "queued", "note": "the disk is full"}
    ended = service.store.jobs.cancel("local", job.id)
    assert job_document(ended, 3600)["progress"] == {"phase": "cancelled"}
    assert job_document(service.store.jobs.resume("local", job.id), 3600)["progress"] == {"phase": "queued"}


def claimed_job(service):
    order = spec(kept(service.store))
    return taken(service.store, queued(service.store, priority=100, spec=order).id)
