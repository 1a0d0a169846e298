"""Calls of both clients against the real application: requests, answers and problems."""

import asyncio
import inspect
from dataclasses import fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

import islands_api
from islands.errors import IslandsError, SettingsError
from islands.evolution.settings import Settings
from islands_api.client import AsyncClient, Client, ServiceError, calls, diagnosis_calls, upload_calls
from islands_api.client.calls import RequestSpec
from islands_api.dataset_schemas import DatasetView
from islands_api.schemas import JobRequest, JobView
from islands_service.domain.job import JobState
from support.service import Service, csv, queued

SPEC = {"inputs": ["u_V"], "output": "y_um"}


@pytest.fixture
def record(tmp_path: Path) -> Path:
    path = tmp_path / "Messung 1 'ä'.csv"
    path.write_bytes(csv())
    return path


def test_package_exports_the_public_names() -> None:
    assert islands_api.Client is Client
    assert islands_api.AsyncClient is AsyncClient
    assert islands_api.ServiceError is ServiceError
    with pytest.raises(AttributeError, match="has no attribute 'Klient'"):
        _ = islands_api.Klient


# Data sets.


@pytest.mark.ci
def test_upload_returns_the_preview_of_the_record(client: Any, record: Path) -> None:
    dataset = client.upload(record, ["u_V"], "y_um")
    assert isinstance(dataset, DatasetView)
    assert dataset.name == record.name
    assert [column.name for column in dataset.preview.columns] == ["t_s", "u_V", "y_um"]
    assert dataset.preview.columns[1].unit == "V"
    assert (dataset.preview.samples, dataset.preview.time) == (200, "t_s")
    assert dataset.preview.dt == pytest.approx(0.01)
    assert dataset.bytes == record.stat().st_size
    assert abs((datetime.now(UTC) - dataset.created).total_seconds()) < 60
    listed = client.datasets().items[0]
    assert (listed.id, listed.columns, listed.samples) == (dataset.id, 3, 200)


@pytest.mark.parametrize("path", ["nowhere.csv", "."])
def test_unreadable_record_raises_the_error_of_its_file(client: Any, path: str) -> None:
    with pytest.raises(OSError, match=r"nowhere\.csv|Is a directory"):
        client.upload(path)


def test_data_set_can_be_deleted_when_no_job_needs_it(client: Any, me: Any) -> None:
    job = client.submit(me.dataset, **SPEC)
    with pytest.raises(ServiceError) as caught:
        client.delete_dataset(me.dataset)
    assert caught.value.type == "/problems/dataset-in-use"
    client.cancel(job)
    assert client.delete_dataset(me.dataset) is None
    assert client.datasets().items == ()


# Jobs.


@pytest.mark.parametrize(
    ("given", "stored"),
    [
        (None, None),
        (0.4, 0.4),
        ("0-csv", {"dataset": "0-csv"}),
        ({"dataset": "0-csv", "rows": "5:"}, {"dataset": "0-csv", "rows": "5:"}),
    ],
)
def test_validation_is_a_fraction_a_data_set_or_its_rows(given: Any, stored: Any) -> None:
    body = calls.submit("1-csv", ["u_V"], "y_um", validation=given).json
    assert body.get("validation") == stored
    JobRequest.model_validate(body)


def test_arguments_of_submit_hide_no_setting() -> None:
    taken = set(inspect.signature(calls.submit).parameters) - {"settings"}
    assert not taken & {each.name for each in fields(Settings)}


@pytest.mark.parametrize(
    "wrong", [{"target_error": float("nan")}, {"validation": float("inf")}, {"idempotency_key": "schlüssel"}]
)
def test_invalid_submission_is_rejected_before_sending(wrong: dict[str, Any]) -> None:
    with pytest.raises(SettingsError, match=r"NaN or infinite|printable ASCII"):
        calls.submit("0-csv", ["u_V"], "y_um", **wrong)


def test_discrepancy_job_contains_all_submitted_values(client: Any, me: Any) -> None:
    simulation = {"kind": "bouc-wen-piezo", "parameters": {"dp": 1.5}}
    job = client.diagnose(
        me.dataset,
        "u_V",
        "y_um",
        simulation,
        tolerance={"dp": 0.01},
        noise_level=0.02,
        seed=7,
        rows=None,
        name="piezo",
        priority=3,
        idempotency_key="mine",
    )
    assert (job.kind, job.state, job.name, job.priority) == ("discrepancy", "queued", "piezo", 3)
    wanted = {"dataset": me.dataset, "input": "u_V", "output": "y_um", "seed": 7}
    given = {"simulation": simulation, "tolerance": {"dp": 0.01}, "noise_level": 0.02}
    assert job.spec == {**wanted, **given}
    assert client.job(job).spec == job.spec
    again = client.diagnose(me.dataset, "u_V", "y_um", "bouc-wen-piezo")
    assert again.spec["simulation"] == {"kind": "bouc-wen-piezo", "parameters": {}}
    for call in (client.report, client.extended, client.result):
        with pytest.raises(ServiceError, match="wait until it has succeeded"):
            call(again)
    with pytest.raises(ServiceError, match="only jobs of the kind identification"):
        client.models(again)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("pendulum", "unknown simulation 'pendulum'"),
        ("model:none.json", "none.json cannot be read"),
        ("python:model.py:run", "a service does not run code of its clients"),
        ("fmu:axis.fmu", "upload the FMU with upload_fmu"),
    ],
)
def test_invalid_simulation_is_rejected_before_sending(text: str, why: str) -> None:
    with pytest.raises(IslandsError, match=why):
        diagnosis_calls.diagnose("0-csv", "u_V", "y_um", text)


def test_queued_job_is_cancelled_resumed_and_deleted(client: Any, me: Any) -> None:
    job = client.submit(me.dataset, **SPEC)
    assert client.cancel(job).state == JobState.CANCELLED
    assert client.resume(job).state == JobState.QUEUED
    client.cancel(job)
    assert client.delete(job) is None
    with pytest.raises(ServiceError) as caught:
        client.job(job)
    assert (caught.value.status, caught.value.type) == (404, "/problems/no-such-job")


def test_job_is_found_by_its_labels(client: Any, me: Any) -> None:
    job = client.submit(me.dataset, **SPEC, name="first", tags="rig 2")
    client.submit(me.dataset, **SPEC)
    assert job.tags == ("rig 2",)
    assert client.label(job, name="second").tags == ("rig 2",)
    changed = client.label(job, tags=["a", "b"])
    assert (changed.name, changed.tags) == ("second", ("a", "b"))
    for filters in ({"tag": "b"}, {"q": "SECOND"}, {"tag": "a", "q": "b", "kind": "identification"}):
        assert [each.id for each in client.jobs(**filters).items] == [job.id]
    assert client.jobs(tag="rig 2").items == client.jobs(kind="discrepancy").items == ()
    assert client.label(job, name="", tags=()).name == ""


# Problems.


@pytest.mark.parametrize(
    ("wrong", "status", "kind", "message"),
    [
        ({"islands": 0}, 422, "invalid-settings", "islands is an integer from 1 to 10000, got 0"),
        ({"preset": "magic"}, 422, "invalid-settings", "unknown preset 'magic'"),
        ({"validation": 1.5}, 422, "invalid-request", "validation"),
        ({"hue": "red"}, 422, "invalid-request", "hue"),
        ({"output": "z"}, 422, "invalid-record", "z"),
        ({"dataset": "0-csv"}, 404, "no-such-dataset", "0-csv"),
    ],
)
def test_problem_is_raised_with_status_type_and_detail(
    client: Any, me: Any, wrong: dict[str, Any], status: int, kind: str, message: str
) -> None:
    with pytest.raises(ServiceError) as caught:
        client.submit(**{"dataset": me.dataset, **SPEC, **wrong})
    error = caught.value
    assert (error.status, error.type) == (status, f"/problems/{kind}")
    assert message in error.detail
    assert str(error) == error.detail == error.document["detail"]
    assert error.document["request_id"]
    assert client.jobs().items == ()


@pytest.mark.parametrize("identity", ["..", "../datasets", "a/b", "a?wait=30", "ä", "", "x" * 65, "%2e%2e"])
def test_malformed_id_is_one_segment_of_the_path(client: Any, identity: str) -> None:
    for call in (client.job, client.models, client.delete, client.cancel):
        with pytest.raises(ServiceError) as caught:
            call(identity)
        assert caught.value.status in (404, 405, 422)


@pytest.mark.parametrize("body", [b"<html>", b"[[1]]", b"5"])
def test_result_that_is_not_an_object_raises_an_error(connect: Any, scripted: Any, body: bytes) -> None:
    with pytest.raises(ServiceError, match="is not an islands service"):
        connect(scripted((200, {}, body)).url).result("0")


# Concurrency and repetition.


def test_concurrent_calls_share_one_client(service: Service, me: Any) -> None:
    async def submit_all() -> list[JobView]:
        async with AsyncClient(service.url, me.secret) as client:
            one = calls.submit(me.dataset, ["u_V"], "y_um", idempotency_key="one")
            return await asyncio.gather(*(client.call(one) for _ in range(16)))

    assert len({job.id for job in asyncio.run(submit_all())}) == 1


def test_calls_declare_whether_they_are_repeatable() -> None:
    made: list[RequestSpec[Any]] = [
        calls.cancel("0"),
        calls.stop("0"),
        calls.resume("0"),
        calls.delete("0"),
        calls.delete_dataset("0"),
    ]
    assert [call.repeatable for call in made] == [True, True, False, False, False]
    assert all(
        call.repeatable
        for call in (calls.job("0"), calls.submit("0", ["u"], "y"), upload_calls.upload("r.csv"))
    )


# Administration.


def test_administrators_list_and_cancel_the_jobs_of_all_owners(
    client: Any, service: Service, administrator: Any
) -> None:
    with pytest.raises(ServiceError, match="admin"):
        client.admin_jobs()
    jobs = {queued(service.store, owner).id: owner for owner in ("first lab", "second lab")}
    listed = administrator.admin_jobs(limit=2)
    assert {job.id: job.owner for job in listed.items} == jobs
    first = administrator.admin_jobs(limit=1)
    second = administrator.admin_jobs(limit=1, cursor=first.next)
    assert [*first.items, *second.items] == [*listed.items]
    (job,) = administrator.admin_jobs("first lab", "queued").items
    assert (job.owner, job.state) == ("first lab", "queued")
    cancelled = administrator.admin_cancel(job)
    assert (cancelled.id, cancelled.owner, cancelled.state) == (job.id, "first lab", "cancelled")
    with pytest.raises(ServiceError, match="cancelled"):
        administrator.admin_cancel(job.id)
