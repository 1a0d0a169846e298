"""The hub: tells everybody who watches a job when it has changed. One query for all, ten times a second."""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import structlog

from islands_api.web.concurrency import BlockingExecutor
from islands_service.domain.job import TERMINAL, Event
from islands_service.store import Store
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Seconds between two looks, and between two tries while the database is away.
LOOK, RETRY = 0.1, 0.5

#: Events that are kept of a watched job, for watchers that are a little behind.
_KEPT = 256


@dataclass(slots=True, eq=False)
class JobFeed:
    """What is known of a watched job."""

    version: int
    subscribers: int = 0
    gone: bool = False
    recent: deque[Event] = field(default_factory=lambda: deque(maxlen=_KEPT))
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def publish(self) -> None:
        """Wake all who wait; the next change is another one."""
        self.changed.set()
        self.changed = asyncio.Event()


class JobEventHub:
    """Feeds of all jobs that somebody watches.

    Parameters
    ----------
    store : Store
    threads : BlockingExecutor
    """

    def __init__(self, store: Store, threads: BlockingExecutor) -> None:
        self._store, self._threads = store, threads
        self._feeds: dict[str, JobFeed] = {}
        self._has_subscribers = asyncio.Event()
        self.closed = False

    async def run(self) -> None:
        """Look for changes until cancelled."""
        while True:
            await self._has_subscribers.wait()
            try:
                await self._poll()
                await asyncio.sleep(LOOK)
            except StoreError as error:
                log.warning("hub cannot look", reason=str(error))
                await asyncio.sleep(RETRY)
            except Exception as error:
                # Whoever watches any job would wait for ever.
                log.error("defect", exc_info=error)
                await asyncio.sleep(RETRY)

    def close(self) -> None:
        """End all streams: their clients come back, and go on where they were."""
        self.closed = True
        for feed in self._feeds.values():
            feed.publish()

    @contextmanager
    def subscribe(self, job: str, version: int) -> Iterator[JobFeed]:
        """Have a job's feed kept up to date in the block, from a version on that is known."""
        feed = self._feeds.setdefault(job, JobFeed(version))
        feed.subscribers += 1
        self._has_subscribers.set()
        try:
            yield feed
        finally:
            feed.subscribers -= 1
            if feed.subscribers == 0:
                del self._feeds[job]
                if not self._feeds:
                    self._has_subscribers.clear()

    async def wait(self, feed: JobFeed, version: int, seconds: float) -> bool:
        """Wait until a job is past a version; return whether it is."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while feed.version <= version and not (feed.gone or self.closed):
                    await feed.changed.wait()
        return feed.version > version

    async def events(self, job: str, version: int, after: int, alive: float) -> AsyncGenerator[Event | None]:
        """Yield a job's events after a number, until it has ended; None where nothing happens for a while."""
        with self.subscribe(job, version) as feed:
            last = after
            while not (feed.gone or self.closed):
                found = await self._after(job, feed, last)
                newest = max((feed.version, *(event.number for event in found)))
                for event in found:
                    yield event
                    last = event.number
                    if event.kind in TERMINAL and last >= newest:
                        return
                if last >= feed.version and not await self.wait(feed, last, alive):
                    yield None

    async def _after(self, job: str, feed: JobFeed, last: int) -> list[Event]:
        if last >= feed.version:
            return []
        if feed.recent and feed.recent[0].number <= last + 1:
            return [event for event in feed.recent if event.number > last]
        # These may be newer than what the feed knows; they reach it, and its other watchers, by its own look.
        try:
            return list(await self._threads.run(self._store.jobs.events, job, last))
        except StoreError as error:
            log.warning("hub cannot read", job=job, reason=str(error))
            await asyncio.sleep(RETRY)
            return []

    async def _poll(self) -> None:
        watched = dict(self._feeds)
        versions = await self._threads.run(self._store.jobs.versions, list(watched))
        for job, feed in watched.items():
            if job not in versions:
                feed.gone = True
                feed.publish()
            elif versions[job] > feed.version:
                news = await self._threads.run(self._store.jobs.events, job, feed.version)
                feed.recent.extend(news)
                feed.version = max((versions[job], *(event.number for event in news)))
                feed.publish()
