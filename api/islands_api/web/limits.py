"""Limits of requests: rates, what an owner has in progress, turns for scarce work, uploads and threads."""

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import AsyncIterator, Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, contextmanager
from contextvars import copy_context
from dataclasses import dataclass, field
from functools import partial
from time import monotonic
from typing import ParamSpec, TypeVar

from anyio import CancelScope

from islands_api.web.problems import RateLimitError, UploadLimitError
from islands_service.domain.job import QuotaError

#: Maximum number of buckets. The least recently used one is dropped; it has refilled in the meantime.
_MAX_BUCKETS = 10_000

#: Value of the header Retry-After in seconds if too many uploads are in progress.
_RETRY_AFTER = 5.0

P = ParamSpec("P")
T = TypeVar("T")

#: Maximum number of blocking operations at once.
MAX_THREADS = 40


class RateLimiter:
    """Token bucket rate limiter.

    Parameters
    ----------
    rate : float
        Requests per second; 0 for no limit.
    burst : int
        Capacity of a bucket: requests that may arrive at once.
    """

    def __init__(self, rate: float, burst: int) -> None:
        self._rate, self._burst = rate, burst
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def acquire(self, client: str, tokens: float = 1.0) -> None:
        """Take tokens from the bucket of a client.

        Raises
        ------
        RateLimitError
            The bucket has too few tokens.
        """
        if not self._rate:
            return
        now = monotonic()
        left, at = self._buckets.get(client, (float(self._burst), now))
        left = min(self._burst, left + (now - at) * self._rate)
        if left < tokens:
            wait = (tokens - left) / self._rate
            raise RateLimitError(
                f"more than {self._rate:g} requests per second: wait {wait:.1f} s; to follow a job, read its "
                "events or use ?wait=30",
                wait,
            )
        self._buckets[client] = left - tokens, now
        self._buckets.move_to_end(client)
        while len(self._buckets) > _MAX_BUCKETS:
            self._buckets.popitem(last=False)


class OwnerCounts:
    """Counts what every owner has in progress, and refuses more than its quota.

    Parameters
    ----------
    what : str
        Plural noun for messages.
    refuse : callable
        Makes the error of a quota that is used up from its message.
    """

    def __init__(self, what: str, refuse: Callable[[str], Exception] = QuotaError) -> None:
        self._what, self._refuse = what, refuse
        self._counts: Counter[str] = Counter()

    @property
    def total(self) -> int:
        """Number in progress of all owners."""
        return self._counts.total()

    @contextmanager
    def count(self, owner: str, most: int) -> Iterator[None]:
        """Count one more during the block.

        Raises
        ------
        QuotaError
            The owner has ``most`` in progress. Another error if `refuse` makes one.
        """
        if self._counts[owner] >= most:
            raise self._refuse(
                f"{self._counts[owner]} {self._what} of this owner are in progress, and {most} is the most: "
                "wait until one has ended"
            )
        self._counts[owner] += 1
        try:
            yield
        finally:
            self._counts[owner] -= 1
            self._counts += Counter()  # drops owners without any


class OwnerSlots:
    """Pool of slots.

    Waiting owners are served in turn, and the requests of one owner in the order of their arrival. While an
    owner waits for a slot that has fewer requests in progress than it may, every other owner is served at
    most once.

    A request for several slots leaves as many free, so that smaller ones do not wait for its end. They pass
    one that does not fit yet.

    Parameters
    ----------
    total : int
        Number of slots.
    per_owner : int
        Maximum number of requests of one owner that hold slots.
    """

    def __init__(self, total: int, per_owner: int) -> None:
        self._free, self._per_owner = total, per_owner
        self._held: Counter[str] = Counter()
        self._waiting: OrderedDict[str, deque[_Turn]] = OrderedDict()

    @asynccontextmanager
    async def hold(self, owner: str, slots: int = 1) -> AsyncIterator[None]:
        """Hold slots during the block; wait for them first."""
        turn = _Turn(slots)
        self._waiting.setdefault(owner, deque()).append(turn)
        self._serve()
        try:
            await turn.served
        except asyncio.CancelledError:
            if turn.served.cancelled():
                self._forget(owner, turn)
                self._serve()  # it may have been in the way of another one of its owner
            else:  # served and cancelled before this task could continue
                self._release(owner, slots)
            raise
        try:
            yield
        finally:
            self._release(owner, slots)

    def _serve(self) -> None:
        """Give the free slots to waiting requests."""
        while owner := next(filter(self._fits, self._waiting), None):
            turn = self._waiting[owner][0]
            self._forget(owner, turn)
            if turn.served.done():  # cancelled, which its task has not noticed yet
                continue
            if owner in self._waiting:
                self._waiting.move_to_end(owner)
            self._free -= turn.slots
            self._held[owner] += 1
            turn.served.set_result(None)

    def _fits(self, owner: str) -> bool:
        """Return whether the first request of an owner can be served, and leave room for one as large.

        A single slot leaves none.
        """
        slots = self._waiting[owner][0].slots
        return slots + (slots - 1) <= self._free and self._held[owner] < self._per_owner

    def _forget(self, owner: str, turn: "_Turn") -> None:
        turns = self._waiting.get(owner, deque())
        if turn in turns:
            turns.remove(turn)
        if not turns:
            self._waiting.pop(owner, None)

    def _release(self, owner: str, slots: int) -> None:
        self._free += slots
        self._held[owner] -= 1
        self._held += Counter()  # drops owners without a slot
        self._serve()


@dataclass(frozen=True, slots=True, eq=False)
class _Turn:
    """Request that waits: the number of its slots, and the future that it waits for."""

    slots: int
    served: asyncio.Future[None] = field(default_factory=lambda: asyncio.get_running_loop().create_future())


class UploadAdmission:
    """Counts the uploads of every owner that are in progress, and the bytes that they may store.

    Parameters
    ----------
    total : int
        Maximum number of uploads in progress.
    """

    def __init__(self, total: int) -> None:
        self._total = total
        self._uploads = OwnerCounts("uploads", _refuse)
        self._reserved: Counter[str] = Counter()

    @contextmanager
    def admit(self, owner: str, most: int) -> Iterator[None]:
        """Count an upload during the block. The owner may have ``most`` in progress.

        Raises
        ------
        UploadLimitError
            Too many uploads are in progress.
        """
        with self._uploads.count(owner, most):
            if self._uploads.total > self._total:
                raise _refuse(f"{self._total} uploads are in progress, the most of this service: try again")
            yield

    @contextmanager
    def reserve(self, owner: str, least: int, most: int, stored: int, max_stored: int) -> Iterator[int]:
        """Reserve bytes of the owner's quota during the block; yield their number.

        Parameters
        ----------
        least, most : int
            Bytes that the upload needs, and that it may have. They differ if its size is not declared.
        stored, max_stored : int
            Bytes that the owner has stored, and may store.

        Raises
        ------
        QuotaError
            The owner has fewer than ``least`` bytes left.
        """
        left = max_stored - stored - self._reserved[owner]
        if left < least:
            raise QuotaError(
                f"the data sets take {stored / 1e6:.1f} MB, uploads in progress "
                f"{self._reserved[owner] / 1e6:.1f} MB, this one has {least / 1e6:.1f} MB, and "
                f"{max_stored / 1e6:.1f} MB is the most: delete some"
            )
        reserved = min(most, left)
        self._reserved[owner] += reserved
        try:
            yield reserved
        finally:
            self._reserved[owner] -= reserved
            self._reserved += Counter()


def _refuse(message: str) -> UploadLimitError:
    return UploadLimitError(message, _RETRY_AFTER)


class BlockingExecutor:
    """Thread pool for blocking operations.

    The framework's own thread pool takes a third of the time of a request for a job.
    """

    def __init__(self) -> None:
        self._pool = ThreadPoolExecutor(MAX_THREADS, "islands-web")

    async def run(self, operation: Callable[P, T], *args: P.args, **kwargs: P.kwargs) -> T:
        """Run an operation in a thread with a copy of the current context, and return its result."""
        call = partial(copy_context().run, operation, *args, **kwargs)
        future = asyncio.get_running_loop().run_in_executor(self._pool, call)
        try:
            return await asyncio.shield(future)
        except asyncio.CancelledError:
            # The client has disconnected, but the thread still runs: keep its files open until it ends.
            with CancelScope(shield=True):
                await asyncio.wait([future])
            raise

    def close(self) -> None:
        """Wait for running operations, then stop the threads."""
        self._pool.shutdown()
