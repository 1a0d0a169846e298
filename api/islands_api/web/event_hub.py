"""Event hub: notifies all subscribers of a job of its changes, with one query for all jobs in each poll."""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field

import structlog

from islands_api.web.limits import BlockingExecutor
from islands_service.domain.job import LABELLED, TERMINAL, Event
from islands_service.logs import OutageLog
from islands_service.store import Store
from islands_service.store.database import StoreError

log = structlog.get_logger()

#: Seconds between two polls of the database.
POLL_SECONDS = 0.1

#: Seconds between two attempts while the database is unavailable.
RETRY_SECONDS = 0.5

#: Number of events kept in memory for each job, for subscribers that lag behind.
_MAX_RECENT_EVENTS = 256


@dataclass(slots=True, eq=False)
class JobFeed:
    """Latest version and recent events of a job that has subscribers."""

    version: int
    subscribers: int = 0
    gone: bool = False
    recent: deque[Event] = field(default_factory=lambda: deque(maxlen=_MAX_RECENT_EVENTS))
    changed: asyncio.Event = field(default_factory=asyncio.Event)

    def publish(self) -> None:
        """Wake all waiting subscribers."""
        self.changed.set()
        self.changed = asyncio.Event()


class JobEventHub:
    """Feeds of all jobs that have subscribers."""

    def __init__(self, store: Store, executor: BlockingExecutor) -> None:
        self._store, self._executor = store, executor
        self._feeds: dict[str, JobFeed] = {}
        self._has_subscribers = asyncio.Event()
        self.closed = False
        self._outage = OutageLog("event hub cannot read", "event hub reads again")

    async def run(self) -> None:
        """Poll for changes until cancelled."""
        while True:
            await self._has_subscribers.wait()
            try:
                await self._poll()
                self._outage.succeed()
                await asyncio.sleep(POLL_SECONDS)
            except StoreError as error:
                self._outage.fail(error)
                await asyncio.sleep(RETRY_SECONDS)
            except Exception as error:
                # Continue: without the hub, all subscribers would wait for ever.
                log.error("defect", exc_info=error)
                await asyncio.sleep(RETRY_SECONDS)

    def close(self) -> None:
        """End all streams. Their clients reconnect and continue after their last event."""
        self.closed = True
        for feed in self._feeds.values():
            feed.publish()

    @contextmanager
    def subscribe(self, job: str, version: int) -> Iterator[JobFeed]:
        """Keep the feed of a job up to date while the block runs, from a known version on."""
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
        """Wait until a job has a newer version, for at most some seconds; return whether it has."""
        with suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while feed.version <= version and not (feed.gone or self.closed):
                    await feed.changed.wait()
        return feed.version > version

    async def events(
        self, job: str, version: int, after: int, alive: float, has_ended: bool = False
    ) -> AsyncGenerator[Event | None]:
        """Yield the events of a job after an event number until it has ended; yield None if idle for a while.

        Parameters
        ----------
        job : str
        version : int
            Known version of the job.
        after : int
            Number of the last event that the client has.
        alive : float
            Seconds without an event after which None is yielded.
        has_ended : bool
            Whether the job has ended at the known version.
        """
        with self.subscribe(job, version) as feed:
            last = after
            while not (feed.gone or self.closed):
                unread = await self._read_events_after(job, feed, last)
                newest = max((feed.version, *(event.number for event in unread)))
                for event in unread:
                    yield event
                    last = event.number
                    if event.kind != LABELLED:
                        has_ended = event.kind in TERMINAL
                    if has_ended and last >= newest:
                        return
                if last >= feed.version and not await self.wait(feed, last, alive):
                    yield None

    async def _read_events_after(self, job: str, feed: JobFeed, last: int) -> list[Event]:
        if last >= feed.version:
            return []
        if feed.recent and feed.recent[0].number <= last + 1:
            return [event for event in feed.recent if event.number > last]
        # These events may be newer than the feed, but are not added to it: the next poll adds them.
        try:
            events = list(await self._executor.run(self._store.jobs.events, job, last))
        except StoreError as error:
            self._outage.fail(error, job=job)
            await asyncio.sleep(RETRY_SECONDS)
            return []
        self._outage.succeed()
        return events

    async def _poll(self) -> None:
        feeds = dict(self._feeds)
        versions = await self._executor.run(self._store.jobs.versions, list(feeds))
        for job, feed in feeds.items():
            if job not in versions:
                feed.gone = True
                feed.publish()
            elif versions[job] > feed.version:
                events = await self._executor.run(self._store.jobs.events, job, feed.version)
                feed.recent.extend(events)
                feed.version = max((versions[job], *(event.number for event in events)))
                feed.publish()
