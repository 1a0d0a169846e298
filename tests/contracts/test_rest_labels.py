"""Labels of jobs over REST: name and tags at submission and later, filters and search of the list."""

import pytest

from islands_api.web.routes import events
from islands_service.domain.job import JobOutcome, JobState
from support.service import held, kept, problem_of, queued, spec
from support.stores import claimed, job_in


@pytest.fixture
def order(service):
    return spec(kept(service.store), name="first")


def ids(service, **filters):
    answer = service.client.get("/v1/jobs", params=filters)
    assert answer.status_code == 200, answer.text
    return [job["id"] for job in answer.json()["items"]]


def test_a_submitted_job_has_its_tags_and_the_name_of_its_data_set(service, order):
    job = service.submit(**order, tags=["rig 2", "cold", "rig 2"]).json()
    assert (job["tags"], job["dataset_name"]) == (["rig 2", "cold"], "record.csv")
    assert "tags" not in job["spec"]
    assert service.client.get(f"/v1/jobs/{job['id']}").json()["tags"] == job["tags"]


def test_a_diagnosis_has_tags(service):
    order = held(kept(service.store))
    job = service.client.post("/v1/discrepancies", json={**order, "tags": ["cold"]}).json()
    assert job["tags"] == ["cold"]
    assert ids(service, tag="cold", kind="discrepancy") == [job["id"]]
    assert ids(service, kind="identification") == []


def test_tags_are_part_of_the_request_of_an_idempotency_key(service, order):
    first = service.submit({"Idempotency-Key": "k"}, **order, tags=["a"])
    again = service.submit({"Idempotency-Key": "k"}, **order, tags=["a"])
    assert again.json()["id"] == first.json()["id"]
    problem_of(service.submit({"Idempotency-Key": "k"}, **order), 422, "idempotency-conflict")


def test_name_and_tags_are_changed_separately(service, order):
    path = service.submit(**order).headers["location"]
    renamed = service.client.patch(path, json={"name": "Bühne 3"})
    assert (renamed.status_code, renamed.json()["name"], renamed.json()["tags"]) == (200, "Bühne 3", [])
    tagged = service.client.patch(path, json={"tags": ["a", "b"]})
    assert (tagged.json()["name"], tagged.json()["tags"]) == ("Bühne 3", ["a", "b"])
    looked = service.client.get(path)
    assert looked.json() == tagged.json()
    assert looked.headers["etag"] == tagged.headers["etag"] == '"3"'
    assert service.client.patch(path, json={}).headers["etag"] == '"3"'


@pytest.mark.parametrize(
    "body",
    [
        {"name": "a\nb"},
        {"name": "x" * 201},
        {"name": 3},
        {"tags": ["a,b"]},
        {"tags": [""]},
        {"tags": [" a"]},
        {"tags": ["a "]},
        {"tags": ["a\tb"]},
        {"tags": ["x" * 41]},
        {"tags": [f"{number}" for number in range(21)]},
        {"tags": "a"},
        {"priority": 3},
        ["a"],
    ],
)
def test_unusable_labels_are_refused(service, body):
    path = f"/v1/jobs/{queued(service.store).id}"
    problem_of(service.client.patch(path, json=body), 422, "invalid-request")
    assert service.client.get(path).headers["etag"] == '"1"'


def test_the_longest_labels_are_accepted(service):
    path = f"/v1/jobs/{queued(service.store).id}"
    body = {"name": "ä" * 200, "tags": [f"{number:02d}" + "ü" * 38 for number in range(20)]}
    answer = service.client.patch(path, json=body)
    assert {name: answer.json()[name] for name in body} == body
    assert ids(service, tag=body["tags"][19]) == [answer.json()["id"]]


def test_a_label_of_an_unknown_job_is_refused(service):
    problem_of(service.client.patch(f"/v1/jobs/{'0' * 32}", json={"name": "a"}), 404, "no-such-job")


def test_the_list_is_searched(service, order):
    first = service.submit(**order, tags=["Rig 2"]).json()["id"]
    second = service.submit(**{**order, "name": "second 100%"}).json()["id"]
    assert ids(service, q="FIRST rig") == [first]
    assert ids(service, q="record.CSV") == [second, first]
    assert ids(service, q="100%") == [second]
    assert ids(service, q="  ") == [second, first]
    assert ids(service, q="first second") == ids(service, q="f_rst") == []
    assert ids(service, tag="Rig 2", state="queued") == [first]
    assert ids(service, tag="Rig") == []


def test_the_list_is_sorted_by_error(service):
    jobs = []
    for error in (2.0, 0.5, 1.0):
        jobs.append(queued(service.store).id)
        summary = {"metrics": {"mape": error}}
        service.store.leases.finish(
            claimed(service.store), JobOutcome(JobState.SUCCEEDED, {}, summary=summary)
        )
    queued(service.store)
    ordered = [jobs[1], jobs[2], jobs[0]]
    assert ids(service, sort="error") == ordered
    first = service.client.get("/v1/jobs", params={"sort": "error", "limit": 2}).json()
    assert ids(service, sort="error", cursor=first["next"]) == ordered[2:]
    problem_of(service.client.get("/v1/jobs", params={"sort": "size"}), 422, "invalid-request")


@pytest.mark.parametrize(
    "filters", [{"kind": "other"}, {"tag": "a,b"}, {"tag": ""}, {"q": "a\x00b"}, {"q": "x" * 201}]
)
def test_unusable_filters_are_refused(service, filters):
    problem_of(service.client.get("/v1/jobs", params=filters), 422, "invalid-request")


def test_a_search_with_many_words_is_refused(service):
    answer = service.client.get("/v1/jobs", params={"q": "a " * 11})
    assert "q has 11 words, and 10 is the most" in problem_of(answer, 422, "invalid-settings")


@pytest.mark.parametrize("seen", [0, 3])
def test_the_stream_of_an_ended_job_ends_after_its_labels(service, monkeypatch, seen):
    """Its last event is no step of the job, which has ended before."""
    monkeypatch.setattr(events, "_KEEP_ALIVE_SECONDS", 0.05)
    job = job_in(service.store, JobState.FAILED, "local").id
    assert service.client.patch(f"/v1/jobs/{job}", json={"name": "after"}).status_code == 200
    answer = service.client.get(f"/v1/jobs/{job}/events", headers={"Last-Event-ID": str(seen)}, timeout=20.0)
    kinds = [line.removeprefix("event: ") for line in answer.text.splitlines() if line.startswith("event")]
    assert kinds == ["queued", "running", "failed", "labelled"][seen:]
