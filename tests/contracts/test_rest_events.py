"""Events over REST: every one, in order, once; also for those who are cut off, and until the end."""

import threading
import time

import httpx
import pytest

from islands_api.web import event_hub
from islands_api.web.auth import LOCAL_OWNER
from islands_api.web.routes import events as routes
from islands_service.store import leases
from support.processes import eventually
from support.service import PATIENCE, emptied, parsed, problem_of, queued
from support.stores import CANCELLED, FAILED, FOUND, brought_on, claimed


@pytest.fixture(scope="module")
def shared(serve):
    with serve() as running:
        yield running
        assert not [entry for entry in running.logs if entry["event"] == "defect"]


@pytest.fixture
def service(shared, monkeypatch):
    monkeypatch.setattr(event_hub, "LOOK", 0.03)
    return emptied(shared)


def followed(service, job, last=None):
    """Read a job's events to their end."""
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    answer = service.client.get(f"/v1/jobs/{job}/events", headers=headers)
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert answer.headers["cache-control"] == "no-store"
    return parsed(answer.text)


def watched(service, job, last=None):
    """Read a job's events in a thread of their own; return it, and the list that they come to."""
    found = []
    thread = threading.Thread(target=lambda: found.extend(followed(service, job, last)))
    thread.start()
    eventually(lambda: open_streams(service) > 0)
    return thread, found


def open_streams(service):
    lines = service.client.get("/metrics").text.splitlines()
    return float(next(line for line in lines if line.startswith("islands_event_streams ")).split()[1])


def test_a_stream_shows_a_jobs_whole_life_and_ends_with_it(service):
    job = queued(service.store).id
    thread, seen = watched(service, job)
    lease = claimed(service.store)
    for generation in range(3):
        time.sleep(0.02 * generation)
        service.store.leases.report(lease, brought_on(generation))
    service.store.leases.finish(lease, FOUND)
    thread.join(PATIENCE)
    kinds = ["queued", "running", "progress", "progress", "progress", "succeeded"]
    assert [(number, kind) for number, kind, _ in seen] == list(enumerate(kinds, start=1))
    assert [data["generation"] for _, kind, data in seen if kind == "progress"] == [0, 1, 2]
    assert seen[-1][2]["best"] == 0.5
    assert all(abs(data["at"] - time.time()) < 60 for _, _, data in seen)
    assert eventually(lambda: open_streams(service) == 0)


@pytest.mark.parametrize("end", [FAILED, CANCELLED])
def test_a_stream_ends_with_every_end(service, end):
    job = queued(service.store).id
    service.store.leases.finish(claimed(service.store), end)
    assert [kind for _, kind, _ in followed(service, job)] == ["queued", "running", end.state]


def test_a_stream_of_a_job_that_is_cancelled_in_the_queue_ends(service):
    job = queued(service.store).id
    thread, seen = watched(service, job)
    service.client.post(f"/v1/jobs/{job}/cancel")
    thread.join(PATIENCE)
    assert [kind for _, kind, _ in seen] == ["queued", "cancelled"]


@pytest.mark.parametrize("last", range(6))
def test_who_comes_back_sees_what_came_after_and_nothing_twice(service, last):
    job = queued(service.store).id
    lease = claimed(service.store)
    for generation in range(3):
        service.store.leases.report(lease, brought_on(generation))
    service.store.leases.finish(lease, FOUND)
    assert [number for number, _, _ in followed(service, job, last)] == list(range(last + 1, 7))


def test_a_stream_that_is_cut_again_and_again_loses_nothing(service):
    job = queued(service.store).id
    lease = claimed(service.store)

    def work():
        for generation in range(40):
            service.store.leases.report(lease, brought_on(generation))
            time.sleep(0.01)
        service.store.leases.finish(lease, FOUND)

    worker = threading.Thread(target=work)
    worker.start()
    seen = []
    while not seen or seen[-1][1] != "succeeded":
        headers = {"Last-Event-ID": str(seen[-1][0] if seen else 0)}
        with service.client.stream("GET", f"/v1/jobs/{job}/events", headers=headers) as answer:
            text = ""
            for piece in answer.iter_text():
                text += piece
                if text.count("\n\n") >= 3:
                    break  # cut off in the midst of it
        seen += parsed(text[: text.rfind("\n\n")])
    worker.join()
    assert [number for number, _, _ in seen] == list(range(1, 44))


@pytest.mark.parametrize("last", [3, 4, 10**9])
def test_who_has_seen_the_end_is_told_not_to_come_back(service, last):
    """A browser opens an event source again after every end, but for 204."""
    job = queued(service.store).id
    service.store.leases.finish(claimed(service.store), FOUND)
    answer = service.client.get(f"/v1/jobs/{job}/events", headers={"Last-Event-ID": str(last)})
    assert (answer.status_code, answer.content) == (204, b"")


def test_a_job_that_goes_on_is_followed_again(service):
    job = queued(service.store).id
    service.store.leases.finish(claimed(service.store), CANCELLED)
    assert [number for number, _, _ in followed(service, job)] == [1, 2, 3]
    service.store.jobs.resume(LOCAL_OWNER, job)
    thread, seen = watched(service, job, last=3)
    service.store.leases.finish(claimed(service.store), FOUND)
    thread.join(PATIENCE)
    assert [(number, kind) for number, kind, _ in seen] == [(4, "queued"), (5, "running"), (6, "succeeded")]


def test_who_claims_to_have_seen_the_future_sees_it_come(service):
    job = queued(service.store).id
    thread, seen = watched(service, job, last=10**9)
    service.store.leases.finish(claimed(service.store), FOUND)
    thread.join(PATIENCE)
    assert [(number, kind) for number, kind, _ in seen] == [(2, "running"), (3, "succeeded")]


def test_silence_is_filled_with_comments(service, monkeypatch):
    monkeypatch.setattr(routes, "_KEEP_ALIVE_SECONDS", 0.05)
    job = queued(service.store).id
    with service.client.stream("GET", f"/v1/jobs/{job}/events") as answer:
        text = ""
        for piece in answer.iter_text():
            text += piece
            if text.count(": alive\n\n") >= 3:
                break
    assert [number for number, _, _ in parsed(text)] == [1]


def test_nobody_follows_what_is_not_theirs(service):
    job = queued(service.store, "somebody else").id
    problem_of(service.client.get(f"/v1/jobs/{job}/events"), 404, "no-such-job")


def test_many_who_watch_see_the_same(service):
    job = queued(service.store).id
    lease = claimed(service.store)
    found = [[] for _ in range(12)]

    def watch(index):
        with httpx.Client(base_url=service.url, timeout=PATIENCE, verify=False) as client:
            found[index] = parsed(client.get(f"/v1/jobs/{job}/events").text)

    watchers = [threading.Thread(target=watch, args=(index,)) for index in range(len(found))]
    for watcher in watchers:
        watcher.start()
    eventually(lambda: open_streams(service) == len(found))
    for generation in range(5):
        service.store.leases.report(lease, brought_on(generation))
    service.store.leases.finish(lease, FOUND)
    for watcher in watchers:
        watcher.join(PATIENCE)
    assert [number for number, _, _ in found[0]] == list(range(1, 9))
    assert all(seen == found[0] for seen in found)


def test_a_long_history_is_shown_without_its_oldest_progress(service, monkeypatch):
    """So many events of progress are kept; what is left is in order, and ends."""
    monkeypatch.setattr(leases, "KEPT", 20)
    job = queued(service.store).id
    lease = claimed(service.store)
    for generation in range(50):
        service.store.leases.report(lease, brought_on(generation))
    service.store.leases.finish(lease, FOUND)
    numbers = [number for number, _, _ in followed(service, job)]
    assert numbers == [1, 2, *range(numbers[2], 54)]
    assert 20 < len(numbers) < 27
