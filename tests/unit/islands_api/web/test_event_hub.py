"""The hub: everybody who watches sees every event once and in order, however late or lagging they are."""

import asyncio
from contextlib import asynccontextmanager, suppress

import pytest
import structlog

from islands_api.web import event_hub as hubs
from islands_api.web.concurrency import BlockingExecutor
from islands_api.web.event_hub import JobEventHub
from islands_service.store import Store
from islands_service.store.database import StoreUnavailableError
from support.stores import CANCELLED, FOUND, LONG, brought_on, claimed, submitted


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    monkeypatch.setattr(hubs, "POLL_SECONDS", 0.02)
    monkeypatch.setattr(hubs, "RETRY_SECONDS", 0.02)


@pytest.fixture
def store(sqlite_database):
    with Store(sqlite_database) as opened:
        yield opened


@asynccontextmanager
async def running(store):
    hub = JobEventHub(store, BlockingExecutor())
    task = asyncio.create_task(hub.run())
    try:
        yield hub
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task


async def told(stream, seen, most=1000):
    """Note the numbers of a stream's events; silence is noted as None."""
    async for event in stream:
        seen.append(None if event is None else event.number)
        if len(seen) >= most:
            break
    return seen


def watching(hub, store, job, after=0, alive=5.0):
    return hub.events(job.id, store.jobs.versions([job.id])[job.id], after, alive)


def test_whoever_comes_late_sees_all_and_the_end(store):
    async def scene():
        job = submitted(store)
        store.leases.finish(claimed(store), FOUND)
        async with running(store) as hub:
            return await told(watching(hub, store, job), [])

    assert asyncio.run(scene()) == [1, 2, 3]


@pytest.mark.parametrize("after", range(12))
def test_whoever_comes_back_sees_what_came_after(store, after):
    async def scene():
        job = submitted(store)
        lease = claimed(store)
        for generation in range(8):
            store.leases.report(lease, brought_on(generation))
        async with running(store) as hub:
            watcher = asyncio.create_task(told(watching(hub, store, job, after), []))
            await asyncio.sleep(0.05)
            store.leases.report(lease, brought_on(8))
            store.leases.finish(lease, FOUND)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scene()) == list(range(after + 1, 13))


def test_watchers_who_come_at_any_time_see_the_same(store):
    """One who reads the past meets events that the feed does not know yet; nobody loses them by that."""

    async def scene():
        job = submitted(store)
        lease = claimed(store)
        async with running(store) as hub:
            watchers = []
            for generation in range(60):
                store.leases.report(lease, brought_on(generation))
                watchers.append(asyncio.create_task(told(watching(hub, store, job, generation % 7), [])))
                await asyncio.sleep(0.005 * (generation % 5))
            store.leases.finish(lease, FOUND)
            return await asyncio.wait_for(asyncio.gather(*watchers), 25.0)

    for generation, seen in enumerate(asyncio.run(scene())):
        assert seen == list(range(generation % 7 + 1, 64))


def test_a_reader_of_the_past_hides_nothing_from_those_who_wait(store):
    """Between two looks of the hub: the feed is at 3, the job at 5, and somebody reads from the start."""

    async def scene():
        job = submitted(store)
        lease = claimed(store)
        hub = JobEventHub(store, BlockingExecutor())
        with hub.subscribe(job.id, 2) as feed:
            store.leases.report(lease, brought_on(0))
            await hub._poll()
            assert [event.number for event in feed.recent] == [3]
            waiting = watching(hub, store, job, after=2)
            assert (await anext(waiting)).number == 3
            store.leases.report(lease, brought_on(1))
            store.leases.report(lease, brought_on(2))
            past = await told(watching(hub, store, job), [], most=5)
            store.leases.report(lease, brought_on(3))
            await hub._poll()
            following = [(await anext(waiting)).number for _ in range(3)]
            await waiting.aclose()
            return past, following

    assert asyncio.run(scene()) == ([1, 2, 3, 4, 5], [4, 5, 6])


def test_silence_is_told(store):
    async def scene():
        job = submitted(store)
        async with running(store) as hub:
            return await told(watching(hub, store, job, alive=0.03), [], most=4)

    assert asyncio.run(scene()) == [1, None, None, None]


def test_a_resumed_job_is_followed_beyond_its_first_end(store):
    async def scene():
        job = submitted(store)
        store.leases.finish(claimed(store), CANCELLED)
        store.jobs.resume(job.owner, job.id)
        async with running(store) as hub:
            watcher = asyncio.create_task(told(watching(hub, store, job), []))
            await asyncio.sleep(0.05)
            store.leases.finish(claimed(store), FOUND)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scene()) == [1, 2, 3, 4, 5, 6]


def test_the_stream_of_a_job_that_is_deleted_ends(store):
    async def scene():
        job = submitted(store)
        async with running(store) as hub:
            watcher = asyncio.create_task(told(watching(hub, store, job), []))
            await asyncio.sleep(0.05)
            store.jobs.cancel(job.owner, job.id)
            store.jobs.delete(job.owner, job.id)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scene())[0] == 1


def test_a_job_that_vanishes_between_two_questions_does_not_blind_the_hub(store, monkeypatch):
    """The version was read, the events are gone: all others are still watched."""

    async def scene():
        doomed, other = submitted(store), submitted(store)
        store.jobs.cancel(doomed.owner, doomed.id)
        answer = store.jobs.events

        def vanishing(job, after=0):
            if job == doomed.id and store.jobs.versions([job]):
                store.jobs.delete(doomed.owner, doomed.id)
            return answer(job, after)

        monkeypatch.setattr(store.jobs, "events", vanishing)
        async with running(store) as hub:
            with hub.subscribe(doomed.id, 1):
                watcher = asyncio.create_task(told(watching(hub, store, other), []))
                await asyncio.sleep(0.1)
                store.jobs.cancel(other.owner, other.id)
                return await asyncio.wait_for(watcher, 25.0)

    with structlog.testing.capture_logs() as logs:
        assert asyncio.run(scene()) == [1, 2]
    assert logs == []


def test_who_leaves_takes_nothing_from_those_who_stay(store):
    async def scene():
        first, second = submitted(store), submitted(store)
        async with running(store) as hub:
            staying = asyncio.create_task(told(watching(hub, store, second), []))
            leaving = asyncio.create_task(told(watching(hub, store, first), []))
            await asyncio.sleep(0.05)
            store.jobs.cancel(first.owner, first.id)
            await asyncio.wait_for(leaving, 25.0)
            await asyncio.sleep(0.05)
            store.jobs.cancel(second.owner, second.id)
            return await asyncio.wait_for(staying, 25.0)

    assert asyncio.run(scene()) == [1, 2]


def test_a_defect_does_not_blind_the_hub(store, monkeypatch):
    async def scene():
        job = submitted(store)
        answer, calls = store.jobs.versions, []

        def failing(jobs):
            calls.append(jobs)
            if len(calls) == 2:
                raise ZeroDivisionError
            return answer(jobs)

        async with running(store) as hub:
            stream = watching(hub, store, job)
            monkeypatch.setattr(store.jobs, "versions", failing)
            watcher = asyncio.create_task(told(stream, []))
            await asyncio.sleep(0.15)
            store.jobs.cancel(job.owner, job.id)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scene()) == [1, 2]


def test_a_stream_outlives_a_database_that_is_away(store, monkeypatch):
    async def scene():
        job = submitted(store)
        answer, calls = store.jobs.events, []

        def away(job, after=0):
            calls.append(job)
            if len(calls) < 4:
                raise StoreUnavailableError("gone: try again")
            return answer(job, after)

        monkeypatch.setattr(store.jobs, "events", away)
        async with running(store) as hub:
            watcher = asyncio.create_task(told(watching(hub, store, job), []))
            await asyncio.sleep(0.05)
            store.jobs.cancel(job.owner, job.id)
            return await asyncio.wait_for(watcher, 25.0)

    assert asyncio.run(scene()) == [1, 2]


def test_waiting_ends_at_the_change_or_at_its_time(store):
    async def scene():
        job = submitted(store)
        loop = asyncio.get_running_loop()
        async with running(store) as hub:
            with hub.subscribe(job.id, 1) as feed:
                began = loop.time()
                assert not await hub.wait(feed, 1, 0.2)
                assert loop.time() - began >= 0.2
                loop.call_later(0.1, store.leases.claim, "other", LONG)
                began = loop.time()
                assert await hub.wait(feed, 1, 20.0)
                assert loop.time() - began < 15.0
                assert await hub.wait(feed, 1, 0.0)

    asyncio.run(scene())


def test_closing_ends_all_streams(store):
    async def scene():
        job = submitted(store)
        async with running(store) as hub:
            watchers = [asyncio.create_task(told(watching(hub, store, job), [])) for _ in range(5)]
            await asyncio.sleep(0.05)
            hub.close()
            return await asyncio.wait_for(asyncio.gather(*watchers), 25.0)

    assert all(seen[0] == 1 for seen in asyncio.run(scene()))


def test_nobody_is_looked_for_when_nobody_watches(store):
    async def scene():
        job = submitted(store)
        async with running(store) as hub:
            await told(watching(hub, store, job), [], most=1)
            async for _ in watching(hub, store, job):
                break
            await asyncio.sleep(0.05)
            return hub._feeds

    assert asyncio.run(scene()) == {}
