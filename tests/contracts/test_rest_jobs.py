"""Jobs over REST: submission, idempotency, conditional requests, pages, state changes and history."""

import threading
import time

import pytest

from islands_api.web.auth import LOCAL_OWNER
from islands_service.domain.job import JobState, Submission
from support.service import kept, problem_of, queued, spec
from support.stores import FOUND, brought_on, claimed, job_in


@pytest.fixture
def order(service):
    return spec(kept(service.store), name="first")


def ids(answer):
    return [job["id"] for job in answer.json()["items"]]


def make_job_in_state(service, state):
    """Make a job in a state; no other job may be queued. Return its id."""
    return job_in(service.store, state, LOCAL_OWNER).id


def test_an_accepted_job_is_at_the_location_of_the_response(service, order):
    answer = service.submit(**order, priority=5)
    assert answer.status_code == 202
    assert answer.headers["retry-after"] == "1"
    assert "idempotent-replayed" not in answer.headers
    looked = service.client.get(answer.headers["location"])
    job, accepted = looked.json(), answer.json()
    assert job["progress"] == {**accepted["progress"], "position": 1} == {"phase": "queued", "position": 1}
    assert job == {**accepted, "progress": job["progress"]}
    assert looked.headers["etag"] == answer.headers["etag"]
    assert (job["state"], job["name"], job["priority"], job["version"]) == ("queued", "first", 5, 1)
    assert job["spec"] == {key: value for key, value in order.items() if key != "name"}


def test_a_repeated_request_with_a_key_returns_the_same_job(service, order):
    first = service.submit({"Idempotency-Key": "k1"}, **order)
    assert "idempotent-replayed" not in first.headers
    claimed(service.store)
    again = service.submit({"Idempotency-Key": "k1"}, **dict(reversed(order.items())))
    assert (again.status_code, again.headers["idempotent-replayed"]) == (202, "true")
    assert again.headers["location"] == first.headers["location"]
    assert (again.json()["id"], again.json()["state"]) == (first.json()["id"], "running")
    assert ids(service.client.get("/v1/jobs")) == [first.json()["id"]]


@pytest.mark.parametrize("change", [{"seed": 1}, {"name": "second"}, {"priority": 1}, {"preset": "narx"}])
def test_another_request_with_the_same_key_is_rejected(service, order, change):
    first = service.submit({"Idempotency-Key": "k1"}, **order).json()["id"]
    answer = service.submit({"Idempotency-Key": "k1"}, **{**order, **change})
    detail = problem_of(answer, 422, "idempotency-conflict")
    assert detail == (
        f"the idempotency key 'k1' belongs to job {first}, which was submitted with a different request: "
        "take a new key"
    )
    assert ids(service.client.get("/v1/jobs")) == [first]


def test_an_unchanged_job_is_answered_with_304(service):
    path = f"/v1/jobs/{queued(service.store).id}"
    tag = service.client.get(path).headers["etag"]
    assert tag == '"1"'
    for given in (tag, f"W/{tag}", f'"0", {tag}', "*"):
        answer = service.client.get(path, headers={"If-None-Match": given})
        assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", tag)
    for given in ('"0"', '"11"', "1", ""):
        assert service.client.get(path, headers={"If-None-Match": given}).status_code == 200
    claimed(service.store)
    answer = service.client.get(path, headers={"If-None-Match": tag})
    assert (answer.status_code, answer.headers["etag"], answer.json()["version"]) == (200, '"2"', 2)


def test_a_waiting_request_is_answered_at_the_change(service):
    path = f"/v1/jobs/{queued(service.store).id}"
    threading.Timer(0.3, claimed, [service.store]).start()
    began = time.monotonic()
    answer = service.client.get(path, params={"wait": 20}, headers={"If-None-Match": '"1"'})
    assert (answer.status_code, answer.json()["state"]) == (200, "running")
    assert 0.3 <= time.monotonic() - began < 15.0


def read_all_pages(service, path, limit, between=lambda: None, **params):
    """Read all pages of a list, with a callback between two pages; return the ids."""
    found, cursor = [], None
    while True:
        given = {"limit": limit, **params} | ({} if cursor is None else {"cursor": cursor})
        answer = service.client.get(path, params=given).json()
        assert len(answer["items"]) <= limit
        found += [each["id"] for each in answer["items"]]
        cursor = answer["next"]
        if cursor is None:
            return found
        between()


@pytest.mark.parametrize("limit", [1, 3, 7, 8, 200])
def test_pages_have_each_job_once_while_jobs_are_added(service, limit):
    before = sorted((job.created, job.id) for job in (queued(service.store) for _ in range(7)))
    newest_first = [identity for _, identity in reversed(before)]
    assert read_all_pages(service, "/v1/jobs", limit) == newest_first
    assert read_all_pages(service, "/v1/jobs", limit, lambda: queued(service.store)) == newest_first


@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/datasets"])
@pytest.mark.parametrize("cursor", ["x", "!!!", "bnVsbA", "WzEsMl0", "WzFlOTk5LCJhIl0"])
def test_invalid_cursors_are_rejected(service, path, cursor):
    detail = problem_of(service.client.get(path, params={"cursor": cursor}), 422, "invalid-settings")
    assert detail == f"{cursor!r} is not a cursor: send `next` of the previous page unchanged"


#: States in which an action is allowed, and the following state; all others are conflicts.
ALLOWED = {
    "cancel": {"queued": "cancelled", "running": "running"},
    "stop": {"running": "running"},
    "resume": {"failed": "queued", "cancelled": "queued"},
    "delete": {"succeeded": None, "failed": None, "cancelled": None},
}


@pytest.mark.parametrize("state", JobState)
@pytest.mark.parametrize("action", ALLOWED)
def test_actions_are_allowed_only_in_certain_states(service, action, state):
    path = f"/v1/jobs/{make_job_in_state(service, state)}"
    before = service.client.get(path).json()
    answer = service.client.delete(path) if action == "delete" else service.client.post(f"{path}/{action}")
    if state not in ALLOWED[action]:
        assert f"job {before['id']} is {state}: " in problem_of(answer, 409, "wrong-state")
        assert service.client.get(path).json() == before
    elif action == "delete":
        assert (answer.status_code, answer.content) == (204, b"")
        problem_of(service.client.get(path), 404, "no-such-job")
    else:
        assert (answer.status_code, answer.json()["state"]) == (202, ALLOWED[action][state])
        assert answer.json() == service.client.get(path).json()
        assert answer.json()["cancel_requested"] == (action == "cancel")
        assert answer.json()["stop_requested"] == (action == "stop")


@pytest.mark.parametrize("state", ["queued", "running", "failed", "cancelled"])
def test_the_result_of_an_unfinished_job_is_not_ready(service, state):
    path = f"/v1/jobs/{make_job_in_state(service, JobState(state))}"
    assert service.client.get(f"{path}/models").json() == {"items": []}
    for of in (
        "/result",
        "/models/1",
        "/models/1/export",
        "/figures",
        "/models/1/figures/loop.svg",
        "/report",
    ):
        detail = problem_of(service.client.get(path + of), 409, "not-finished")
        assert f"is {state} and has no result: " in detail
        assert ("wait" in detail) == (state in ("queued", "running"))


def test_the_history_of_a_search_starts_after_a_generation(service):
    job = queued(service.store).id
    lease = claimed(service.store)
    for generation in range(5):
        service.store.leases.report(lease, brought_on(generation))
    path = f"/v1/jobs/{job}/history"
    points = service.client.get(path).json()["items"]
    assert [point["generation"] for point in points] == list(range(5))
    assert points[1] == {"generation": 1, "evaluations": 10, "best": {"3": 0.5}, "islands": [0.5, None]}
    assert service.client.get(path, params={"after": 2}).json()["items"] == points[3:]
    assert service.client.get(path, params={"after": 99}).json()["items"] == []


def test_figures_of_a_job_of_another_version_are_rejected(service):
    job, _ = service.store.jobs.submit(Submission(LOCAL_OWNER, {**spec("0-csv"), "colour": "red"}))
    service.store.leases.finish(claimed(service.store), FOUND)
    answer = service.client.get(f"/v1/jobs/{job.id}/models/1/figures/loop.svg")
    detail = problem_of(answer, 422, "invalid-settings")
    assert "this version of islands cannot read the job (colour: " in detail
    assert "submit it again" in detail


def test_cached_figures_vary_with_the_key(service):
    job = make_job_in_state(service, JobState.SUCCEEDED)
    blob = service.app.state.islands.blobs.write(b"<svg/>" * 1000)
    service.store.results.keep(job, {"1/loop.svg": blob})
    headers = service.client.get(f"/v1/jobs/{job}/models/1/figures/loop.svg").headers
    assert headers["cache-control"] == "private, max-age=86400, immutable"
    assert headers["vary"] == "Authorization, Accept-Encoding"
