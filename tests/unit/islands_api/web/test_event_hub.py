"""Event hub: every subscriber gets each event once and in order, even if it is late or slow."""

import asyncio
from contextlib import asynccontextmanager, suppress

import pytest
import structlog

from islands_api.web import event_hub as hubs
from islands_api.web.event_hub import JobEventHub
from islands_api.web.limits import BlockingExecutor
from islands_service.store import Store
from islands_service.store.database import StoreUnavailableError
from support.stores import FOUND, brought_on, claimed, submitted


@pytest.fixture(autouse=True)
def fast_polling(monkeypatch):
    monkeypatch.setattr(hubs, "POLL_SECONDS", 0.02)
    monkeypatch.setattr(hubs, "RETRY_SECONDS", 0.02)


@pytest.fixture
def store(sqlite_database):
    with Store(sqlite_database) as opened:
        yield opened


@asynccontextmanager
async def running_hub(store):
    hub = JobEventHub(store, BlockingExecutor())
    task = asyncio.create_task(hub.run())
    try:
        yield hub
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def collect(stream, seen, most=1000):
    """Collect the numbers of the events of a stream; idle periods are None."""
    async for event in stream:
        seen.append(None if event is None else event.number)
        if len(seen) >= most:
            break
    return seen


def open_stream(hub, store, job, after=0, alive=5.0):
    return hub.events(job.id, store.jobs.versions([job.id])[job.id], after, alive)


@pytest.mark.parametrize("after", range(12))
def test_a_returning_subscriber_gets_all_later_events(store, after):
    async def scenario():
        job = submitted(store)
        lease = claimed(store)
        for generation in range(8):
            store.leases.report(lease, brought_on(generation))
        async with running_hub(store) as hub:
            watcher = asyncio.create_task(collect(open_stream(hub, store, job, after), []))
            await asyncio.sleep(0.05)
            store.leases.report(lease, brought_on(8))
            store.leases.finish(lease, FOUND)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scenario()) == list(range(after + 1, 13))


def test_reading_old_events_hides_none_from_waiting_subscribers(store):
    """Between two polls the feed is at event 3 and the job at 5; a third subscriber reads from the start."""

    async def scenario():
        job = submitted(store)
        lease = claimed(store)
        hub = JobEventHub(store, BlockingExecutor())
        with hub.subscribe(job.id, 2) as feed:
            store.leases.report(lease, brought_on(0))
            await hub._poll()
            assert [event.number for event in feed.recent] == [3]
            waiting = open_stream(hub, store, job, after=2)
            assert (await anext(waiting)).number == 3
            store.leases.report(lease, brought_on(1))
            store.leases.report(lease, brought_on(2))
            past = await collect(open_stream(hub, store, job), [], most=5)
            store.leases.report(lease, brought_on(3))
            await hub._poll()
            following = [(await anext(waiting)).number for _ in range(3)]
            await waiting.aclose()
            return past, following

    assert asyncio.run(scenario()) == ([1, 2, 3, 4, 5], [4, 5, 6])


def test_the_stream_of_a_deleted_job_ends(store):
    async def scenario():
        job = submitted(store)
        async with running_hub(store) as hub:
            watcher = asyncio.create_task(collect(open_stream(hub, store, job), []))
            await asyncio.sleep(0.05)
            store.jobs.cancel(job.owner, job.id)
            store.jobs.delete(job.owner, job.id)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scenario())[0] == 1


def test_a_job_deleted_during_a_poll_does_not_stop_the_hub(store, monkeypatch):
    """The version was read before the deletion, the events after it; other jobs are still polled."""

    async def scenario():
        doomed, other = submitted(store), submitted(store)
        store.jobs.cancel(doomed.owner, doomed.id)
        answer = store.jobs.events

        def vanishing(job, after=0):
            if job == doomed.id and store.jobs.versions([job]):
                store.jobs.delete(doomed.owner, doomed.id)
            return answer(job, after)

        monkeypatch.setattr(store.jobs, "events", vanishing)
        async with running_hub(store) as hub:
            with hub.subscribe(doomed.id, 1):
                watcher = asyncio.create_task(collect(open_stream(hub, store, other), []))
                await asyncio.sleep(0.1)
                store.jobs.cancel(other.owner, other.id)
                return await asyncio.wait_for(watcher, 25.0)

    with structlog.testing.capture_logs() as logs:
        assert asyncio.run(scenario()) == [1, 2]
    assert logs == []


def test_a_defect_during_a_poll_does_not_stop_the_hub(store, monkeypatch):
    async def scenario():
        job = submitted(store)
        answer, calls = store.jobs.versions, []

        def failing(jobs):
            calls.append(jobs)
            if len(calls) == 2:
                raise ZeroDivisionError
            return answer(jobs)

        async with running_hub(store) as hub:
            stream = open_stream(hub, store, job)
            monkeypatch.setattr(store.jobs, "versions", failing)
            watcher = asyncio.create_task(collect(stream, []))
            await asyncio.sleep(0.15)
            store.jobs.cancel(job.owner, job.id)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scenario()) == [1, 2]


@pytest.mark.parametrize("name", ["events", "versions"])
def test_a_stream_survives_a_database_outage_which_is_logged_once(store, monkeypatch, name):
    async def scenario():
        job = submitted(store)
        answer, calls = getattr(store.jobs, name), []

        def away(*arguments):
            calls.append(arguments)
            # The first call opens the stream.
            if len(calls) < 6 and (name == "events" or len(calls) > 1):
                raise StoreUnavailableError("gone: try again")
            return answer(*arguments)

        monkeypatch.setattr(store.jobs, name, away)
        async with running_hub(store) as hub:
            watcher = asyncio.create_task(collect(open_stream(hub, store, job), []))
            await asyncio.sleep(0.05)
            store.jobs.cancel(job.owner, job.id)
            return await asyncio.wait_for(watcher, 25.0)

    with structlog.testing.capture_logs() as logs:
        assert asyncio.run(scenario()) == [1, 2]
    assert [entry["log_level"] for entry in logs] == ["warning", "info"]
