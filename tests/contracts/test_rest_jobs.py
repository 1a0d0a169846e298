"""Jobs over REST: submission, idempotency, conditional requests, pages, state changes and history."""

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from islands_api import Client
from islands_api.web.auth import LOCAL_OWNER
from islands_service.domain.job import JobState, ProgressReport, Submission
from islands_service.store.tenants.keys import SCOPES
from support.service import kept, problem_of, queued, spec
from support.stores import FOUND, brought_on, claimed, job_in

MANY = 16


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


def test_a_replay_returns_the_job_after_its_data_set_was_deleted(service, order):
    """A client that lost the first response repeats its request, possibly after the data set was deleted."""
    first = service.submit({"Idempotency-Key": "k1"}, **order)
    service.client.post(f"{first.headers['location']}/cancel")
    assert service.client.delete(f"/v1/datasets/{order['dataset']}").status_code == 204
    again = service.submit({"Idempotency-Key": "k1"}, **order)
    assert (again.status_code, again.headers["idempotent-replayed"]) == (202, "true")
    assert (again.json()["id"], again.json()["state"]) == (first.json()["id"], "cancelled")
    other = service.submit({"Idempotency-Key": "k1"}, **{**order, "seed": 1})
    problem_of(other, 422, "idempotency-conflict")
    problem_of(service.submit({"Idempotency-Key": "k2"}, **order), 404, "no-such-dataset")
    problem_of(service.submit(**order), 404, "no-such-dataset")


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


def test_idempotency_keys_are_separate_for_each_owner(service, order):
    mine = service.submit({"Idempotency-Key": "k1"}, **order).json()["id"]
    header = service.key(owner="other")
    theirs = service.submit({"Idempotency-Key": "k1", **header}, **spec(kept(service.store, "other")))
    assert theirs.status_code == 202
    assert theirs.json()["id"] != mine


@pytest.mark.parametrize("key", ["", "x" * 256])
def test_an_idempotency_key_has_1_to_255_characters(service, order, key):
    problem_of(service.submit({"Idempotency-Key": key}, **order), 422, "invalid-request")


def test_concurrent_requests_with_one_key_make_one_job(service, order):
    with ThreadPoolExecutor(MANY) as pool:
        answers = list(pool.map(lambda _: service.submit({"Idempotency-Key": "k"}, **order), range(MANY)))
    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["id"] for answer in answers}) == 1
    assert [answer.headers.get("idempotent-replayed") for answer in answers].count("true") == MANY - 1
    assert len(ids(service.client.get("/v1/jobs"))) == 1


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


def test_a_waiting_request_times_out_with_304(service):
    path = f"/v1/jobs/{queued(service.store).id}"
    began = time.monotonic()
    answer = service.client.get(path, params={"wait": 0.4}, headers={"If-None-Match": '"1"'})
    assert answer.status_code == 304
    assert 0.4 <= time.monotonic() - began < 15.0


@pytest.mark.parametrize("headers", [{}, {"If-None-Match": '"0"'}])
def test_a_request_without_a_matching_etag_does_not_wait(service, headers):
    path = f"/v1/jobs/{queued(service.store).id}"
    began = time.monotonic()
    assert service.client.get(path, params={"wait": 20}, headers=headers).status_code == 200
    assert time.monotonic() - began < 15.0


def test_a_request_for_an_ended_job_does_not_wait(service):
    path = f"/v1/jobs/{make_job_in_state(service, JobState.SUCCEEDED)}"
    tag = service.client.get(path).headers["etag"]
    began = time.monotonic()
    answer = service.client.get(path, params={"wait": 20}, headers={"If-None-Match": tag})
    assert answer.status_code == 304
    assert "retry-after" not in answer.headers
    assert time.monotonic() - began < 15.0


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


def test_pages_have_each_data_set_once_while_others_are_added(service):
    before = [kept(service.store, content=b"%d" % index) for index in range(7)]
    more = iter(range(100))
    found = read_all_pages(
        service, "/v1/datasets", 2, lambda: kept(service.store, content=b"x%d" % next(more))
    )
    assert sorted(found) == sorted(before)


def test_pages_of_a_state_contain_only_jobs_in_it(service):
    running = {make_job_in_state(service, JobState.RUNNING) for _ in range(3)}
    waiting = {queued(service.store).id for _ in range(3)}
    assert set(read_all_pages(service, "/v1/jobs", 2, state="queued")) == waiting
    assert set(read_all_pages(service, "/v1/jobs", 2, state="running")) == running
    assert read_all_pages(service, "/v1/jobs", 2, state="failed") == []


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


def test_queued_jobs_show_their_position_among_those_of_all_owners(service, order, monkeypatch):
    monkeypatch.setattr("islands_api.web.responses._PLACE_SECONDS", 0.0)
    first, second = (service.submit(**order, priority=each).json()["id"] for each in (1, 0))
    urgent = service.submit(service.key(owner="other"), **spec(kept(service.store, "other")), priority=7)
    assert urgent.status_code == 202
    listed = {
        each["id"]: each["progress"]["position"] for each in service.client.get("/v1/jobs").json()["items"]
    }
    # The owners have turns, whatever the priority.
    assert listed == {first: 1, second: 3}
    assert service.client.get(f"/v1/jobs/{second}").json()["progress"]["position"] == 3
    assert claimed(service.store).job.id == first
    assert service.client.get(f"/v1/jobs/{second}").json()["progress"]["position"] == 2
    assert claimed(service.store).job.owner == "other"
    service.store.owners.change(LOCAL_OWNER, {"max_running": 1})
    assert service.client.get(f"/v1/jobs/{second}").json()["progress"] == {
        "phase": "queued",
        "position": 1,
        "note": "waits for your quota of running jobs: 1 of 1 are running",
    }


def test_job_states_its_run_time_and_its_limit(service, order):
    job = service.submit(**order).json()
    default = service.client.get(f"/v1/jobs/{job['id']}").json()
    assert (job["max_run_seconds"], default["max_run_seconds"], default["run_seconds"]) == (3600, 3600, 0.0)
    service.store.owners.change(LOCAL_OWNER, {"max_run_seconds": 7200})
    service.store.leases.renew(claimed(service.store), 60.0, ran=7.26)
    raised = service.client.get(f"/v1/jobs/{job['id']}").json()
    assert (raised["max_run_seconds"], raised["run_seconds"]) == (7200, 7.3)
    assert service.submit(**order).json()["max_run_seconds"] == 7200
    service.store.owners.change(LOCAL_OWNER, {"max_run_seconds": None})
    assert service.client.get(f"/v1/jobs/{job['id']}").json()["max_run_seconds"] == 3600


def test_cancelling_a_job_twice_is_allowed(service):
    path = f"/v1/jobs/{make_job_in_state(service, JobState.RUNNING)}"
    first = service.client.post(f"{path}/cancel")
    assert service.client.post(f"{path}/cancel").json() == first.json()


def test_a_data_set_is_deleted_only_if_no_job_needs_it(service, order):
    path = f"/v1/datasets/{order['dataset']}"
    job = service.submit(**order).json()["id"]
    detail = problem_of(service.client.delete(path), 409, "dataset-in-use")
    assert f"job {job} needs data set" in detail
    service.client.post(f"/v1/jobs/{job}/cancel")
    assert service.client.delete(path).status_code == 204
    problem_of(service.client.get(path), 404, "no-such-dataset")
    problem_of(service.client.delete(path), 404, "no-such-dataset")


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


def test_the_history_of_many_islands_has_small_pages(service):
    asked = {**spec("0-csv"), "settings": {"islands": 256}}
    job, _ = service.store.jobs.submit(Submission(LOCAL_OWNER, asked))
    points = tuple((at, 60 * at, {"3": 0.5}, (1.0 / 3.0,) * 256) for at in range(400))
    service.store.leases.report(claimed(service.store), ProgressReport({"generation": 399}, points))
    path, sizes, seen = f"/v1/jobs/{job.id}/history", [], [-1]
    while not sizes or sizes[-1]:
        answer = service.client.get(path, params={"after": seen[-1]})
        assert len(answer.content) < 3_000_000
        sizes.append(len(answer.json()["items"]))
        seen += [point["generation"] for point in answer.json()["items"]]
    assert seen[1:] == list(range(400))
    assert sizes == [390, 10, 0]


def test_figures_of_a_job_of_another_version_are_rejected(service):
    job, _ = service.store.jobs.submit(Submission(LOCAL_OWNER, {**spec("0-csv"), "colour": "red"}))
    service.store.leases.finish(claimed(service.store), FOUND)
    answer = service.client.get(f"/v1/jobs/{job.id}/models/1/figures/loop.svg")
    detail = problem_of(answer, 422, "invalid-settings")
    assert "this version of islands cannot read the job (colour: " in detail
    assert "submit it again" in detail


@pytest.mark.parametrize("loop", [True, False])
def test_only_a_result_with_a_loop_has_the_loop_figure(service, loop):
    job = service.store.jobs.submit(Submission(LOCAL_OWNER, spec("0-csv")))[0].id
    service.store.leases.finish(claimed(service.store), replace(FOUND, document={"loop": loop}))
    path = f"/v1/jobs/{job}/models/1/figures"
    names = service.client.get(path).json()["items"]
    assert names == ["free-run", *(["loop"] if loop else []), "hold", "residuals"]
    if not loop:
        assert "no figure 'loop'" in problem_of(service.client.get(f"{path}/loop.svg"), 404, "not-found")


def test_cached_figures_vary_with_the_key(service):
    job = make_job_in_state(service, JobState.SUCCEEDED)
    blob = service.app.state.islands.blobs.write(b"<svg/>" * 1000)
    service.store.results.keep(job, {"1/loop.svg": blob})
    headers = service.client.get(f"/v1/jobs/{job}/models/1/figures/loop.svg").headers
    assert headers["cache-control"] == "private, max-age=86400, immutable"
    assert headers["vary"] == "Authorization, Accept-Encoding"


def test_a_queued_job_states_the_time_until_enough_running_jobs_have_ended(service, order, monkeypatch):
    monkeypatch.setattr("islands_api.web.responses._PLACE_SECONDS", 0.0)

    def read(job):
        return service.client.get(f"/v1/jobs/{job}").json()["progress"]

    running = [service.submit(**order).json()["id"] for _ in range(2)]
    leases = [claimed(service.store) for _ in running]
    first, second, third = (service.submit(**order).json()["id"] for _ in range(3))
    # Nothing is known about the running jobs.
    assert "seconds_to_start" not in read(first)
    service.store.leases.report(leases[0], ProgressReport({"phase": "search", "seconds_left": 300.0}))
    assert read(first)["seconds_to_start"] == pytest.approx(300.0, abs=20.0)
    # One known end lets only one job start.
    assert "seconds_to_start" not in read(second)
    service.store.leases.report(leases[1], ProgressReport({"phase": "search", "seconds_left": 100.0}))
    starts = [read(job).get("seconds_to_start") for job in (first, second, third)]
    assert starts[:2] == [pytest.approx(100.0, abs=20.0), pytest.approx(300.0, abs=20.0)]
    # The duration of a queued job is unknown.
    assert starts[2] is None
    service.store.owners.change(LOCAL_OWNER, {"max_running": 2})
    assert read(first).keys() == {"phase", "position", "note"}


def test_a_caller_knows_its_owner_and_its_scopes(service):
    with Client(str(service.client.base_url)) as client:
        found = client.caller()
    assert (found.owner, set(found.scopes)) == (LOCAL_OWNER, set(SCOPES))
