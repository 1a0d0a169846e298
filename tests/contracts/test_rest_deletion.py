"""Deletion over REST: results keep what their figures need, keys keep their meaning, lists show the rest."""

import pytest

from islands_service.domain.job import JobState
from support.service import csv, kept, problem_of, run_identification, spec
from support.stores import job_in


@pytest.mark.nightly
def test_figures_are_drawn_after_the_data_set_was_deleted(service):
    job = run_identification(service)
    dataset = f"/v1/datasets/{service.client.get(f'/v1/jobs/{job}').json()['spec']['dataset']}"
    assert service.client.delete(dataset).status_code == 204
    problem_of(service.client.get(dataset), 404, "no-such-dataset")
    for path in ("figures/record.svg", "report", "models/1/simulation"):
        assert service.client.get(f"/v1/jobs/{job}/{path}").status_code == 200
    # The blob is kept until the job is deleted, and is then swept.
    (blob,) = {row.blob for row in [service.store.datasets.get("local", dataset[13:], deleted=True)]}
    assert blob in service.store.retention.named_blobs()
    assert service.client.delete(f"/v1/jobs/{job}").status_code == 204
    assert service.store.retention.named_blobs() == frozenset()


@pytest.mark.ci
def test_a_job_without_its_data_set_is_resumed_only_after_the_same_upload(service):
    dataset = service.upload(csv()).json()["id"]
    job = job_in(service.store, JobState.CANCELLED, "local", spec=spec(dataset)).id
    assert service.client.delete(f"/v1/datasets/{dataset}").status_code == 204
    detail = problem_of(service.client.post(f"/v1/jobs/{job}/resume"), 409, "dataset-deleted")
    assert "upload the same file again" in detail
    assert service.upload(csv()).status_code == 201
    assert service.client.post(f"/v1/jobs/{job}/resume").json()["state"] == "queued"


def test_a_repeated_request_after_the_deletion_of_its_job_creates_no_second_one(service):
    order = spec(kept(service.store))
    first = service.submit({"Idempotency-Key": "k"}, **order)
    path = first.headers["location"]
    service.client.post(f"{path}/cancel")
    assert service.client.delete(path).status_code == 204
    again = service.submit({"Idempotency-Key": "k"}, **order)
    assert "take a new key" in problem_of(again, 410, "job-deleted")
    problem_of(service.submit({"Idempotency-Key": "k"}, **order, seed=5), 422, "idempotency-conflict")
    assert service.client.get("/v1/jobs").json()["items"] == []
    assert service.submit({"Idempotency-Key": "k2"}, **order).status_code == 202


@pytest.mark.ci
def test_a_list_of_wide_data_sets_has_no_columns(service):
    rows = ["t_s," + ",".join(f"c{each}_V" for each in range(300))]
    rows += [
        ",".join(str(0.01 * row + each % 7 + each * row % 5) for each in range(301)) for row in range(20)
    ]
    made = service.upload("\n".join(rows).encode(), "wide.csv")
    assert made.status_code == 201, made.text
    listed = service.client.get("/v1/datasets")
    assert len(listed.content) < 600
    (item,) = listed.json()["items"]
    assert (item["samples"], item["columns"], item["name"]) == (20, 301, "wide.csv")
    whole = service.client.get(f"/v1/datasets/{item['id']}").json()
    assert whole == made.json()
    assert len(whole["preview"]["columns"]) == 301
