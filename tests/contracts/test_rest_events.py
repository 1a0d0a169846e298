"""Event streams over REST: each event once and in order, also after reconnections."""

import threading
import time

import pytest

from islands_api.web import event_hub
from islands_service.store import leases
from support.processes import eventually
from support.service import PATIENCE, emptied, parse_events, queued
from support.stores import FOUND, brought_on, claimed


@pytest.fixture(scope="module")
def shared(serve):
    with serve() as running:
        yield running
        assert not [entry for entry in running.logs if entry["event"] == "defect"]


@pytest.fixture
def service(shared, monkeypatch):
    monkeypatch.setattr(event_hub, "POLL_SECONDS", 0.03)
    return emptied(shared)


def read_events(service, job, last=None):
    """Read the event stream of a job to its end."""
    headers = {} if last is None else {"Last-Event-ID": str(last)}
    answer = service.client.get(f"/v1/jobs/{job}/events", headers=headers)
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/event-stream")
    assert answer.headers["cache-control"] == "no-store"
    return parse_events(answer.text)


def start_reader(service, job, last=None):
    """Read the events of a job in a thread; return the thread and the list of events."""
    found = []
    thread = threading.Thread(target=lambda: found.extend(read_events(service, job, last)))
    thread.start()
    eventually(lambda: open_streams(service) > 0)
    return thread, found


def open_streams(service):
    lines = service.client.get("/metrics").text.splitlines()
    return float(next(line for line in lines if line.startswith("islands_event_streams ")).split()[1])


def test_a_stream_has_all_events_of_a_job_and_ends_with_it(service):
    job = queued(service.store).id
    thread, seen = start_reader(service, job)
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


@pytest.mark.parametrize("last", range(6))
def test_a_reconnected_stream_has_each_later_event_once(service, last):
    job = queued(service.store).id
    lease = claimed(service.store)
    for generation in range(3):
        service.store.leases.report(lease, brought_on(generation))
    service.store.leases.finish(lease, FOUND)
    assert [number for number, _, _ in read_events(service, job, last)] == list(range(last + 1, 7))


def test_a_repeatedly_broken_stream_loses_no_event(service):
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
                    break  # disconnect within an event
        seen += parse_events(text[: text.rfind("\n\n")])
    worker.join()
    assert [number for number, _, _ in seen] == list(range(1, 44))


@pytest.mark.parametrize("last", [3, 4, 10**9])
def test_a_stream_after_the_last_event_returns_204(service, last):
    """An EventSource of a browser reconnects after every other end of a stream."""
    job = queued(service.store).id
    service.store.leases.finish(claimed(service.store), FOUND)
    answer = service.client.get(f"/v1/jobs/{job}/events", headers={"Last-Event-ID": str(last)})
    assert (answer.status_code, answer.content) == (204, b"")


def test_a_long_stream_omits_the_oldest_progress_events(service, monkeypatch):
    """Only a limited number of progress events is stored; the remaining events are complete and in order."""
    monkeypatch.setattr(leases, "KEPT", 20)
    job = queued(service.store).id
    lease = claimed(service.store)
    for generation in range(50):
        service.store.leases.report(lease, brought_on(generation))
    service.store.leases.finish(lease, FOUND)
    numbers = [number for number, _, _ in read_events(service, job)]
    assert numbers == [1, 2, *range(numbers[2], 54)]
    assert 20 < len(numbers) < 27
