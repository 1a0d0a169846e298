"""Limits of requests: rates, counts, fair turns, uploads and threads."""

import asyncio
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from contextvars import ContextVar

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from islands_api.web import limits
from islands_api.web.limits import BlockingExecutor, OwnerCounts, OwnerSlots, RateLimiter, UploadAdmission
from islands_api.web.problems import RateLimitError
from islands_service.domain.job import QuotaError

OWNERS = "abc"

#: An owner's request arrives; the request of a place among those that hold or wait ends or is cancelled.
EVENTS = st.lists(
    st.tuples(
        st.sampled_from(["arrive", "arrive", "end", "cancel"]), st.sampled_from(OWNERS), st.integers(0, 5)
    ),
    min_size=20,
    max_size=60,
)

request_name: ContextVar[str] = ContextVar("request_name", default="")


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test advances."""

    class Clock:
        now = 100.0

    monkeypatch.setattr(limits, "monotonic", lambda: Clock.now)
    return Clock


def count_accepted(bucket, client, most=1000):
    """Return the number of requests of a client that are accepted."""
    for count in range(most):
        try:
            bucket.acquire(client)
        except RateLimitError:
            return count
    return most


def test_a_full_bucket_allows_a_burst_and_refills_at_the_rate(clock):
    bucket = RateLimiter(rate=5.0, burst=20)
    assert count_accepted(bucket, "a") == 20
    clock.now += 2.0
    assert count_accepted(bucket, "a") == 10
    clock.now += 1000.0
    assert count_accepted(bucket, "a") == 20


def test_a_rejection_gives_the_time_to_wait(clock):
    bucket = RateLimiter(rate=0.5, burst=1)
    bucket.acquire("a")
    clock.now += 0.5
    with pytest.raises(RateLimitError, match=r"more than 0\.5 requests per second: wait 1\.5 s") as refused:
        bucket.acquire("a")
    clock.now += refused.value.seconds
    bucket.acquire("a")


def test_the_number_of_buckets_is_bounded(clock, monkeypatch):
    monkeypatch.setattr(limits, "_MAX_BUCKETS", 10)
    bucket = RateLimiter(rate=1.0, burst=2)
    bucket.acquire("first")
    for number in range(1000):
        bucket.acquire(f"address {number}")
    assert len(bucket._buckets) == 10
    assert count_accepted(bucket, "first") == 2


def test_each_owner_has_its_own_count_until_the_end_of_the_block():
    counts = OwnerCounts("event streams")
    for _ in range(2):
        with ExitStack() as stack:
            for owner in "aab":
                stack.enter_context(counts.count(owner, 2))
            with pytest.raises(QuotaError, match="2 event streams of this owner"), counts.count("a", 2):
                pass
            stack.enter_context(counts.count("b", 2))


def test_a_quota_of_zero_refuses_everything():
    with pytest.raises(QuotaError), OwnerCounts("event streams").count("a", 0):
        pass


class Requests:
    """Requests to a pool, and which of them hold a slot."""

    def __init__(self, total: int, per_owner: int) -> None:
        self.slots, self.total, self.per_owner = OwnerSlots(total, per_owner), total, per_owner
        self.held: dict[asyncio.Task[None], tuple[str, asyncio.Event]] = {}
        self.waiting: dict[asyncio.Task[None], str] = {}
        self.served: list[str] = []

    async def _request(self, owner: str, slots: int) -> None:
        task, ended = asyncio.current_task(), asyncio.Event()
        async with self.slots.hold(owner, slots):
            self.waiting.pop(task)
            self.held[task] = owner, ended
            self.served.append(owner)
            try:
                await ended.wait()
            finally:
                del self.held[task]

    async def arrive(self, owner: str, slots: int = 1) -> asyncio.Task[None]:
        task = asyncio.create_task(self._request(owner, slots))
        self.waiting[task] = owner
        await self.settle()
        return task

    async def end(self, place: int) -> None:
        if self.held:
            list(self.held.values())[place % len(self.held)][1].set()
            await self.settle()

    async def cancel(self, place: int) -> None:
        tasks = [*self.held, *self.waiting]
        if tasks:
            task = tasks[place % len(tasks)]
            self.waiting.pop(task, None)
            task.cancel()
            await self.settle()

    async def settle(self) -> None:
        for _ in range(6):
            await asyncio.sleep(0)

    def below_maximum(self) -> set[str]:
        """Return the waiting owners that hold fewer slots than they may."""
        holding = Counter(owner for owner, _ in self.held.values())
        return {owner for owner in self.waiting.values() if holding[owner] < self.per_owner}

    def check_limits(self) -> None:
        holding = Counter(owner for owner, _ in self.held.values())
        assert len(self.held) <= self.total
        assert max(holding.values(), default=0) <= self.per_owner
        assert len(self.held) == self.total or not self.below_maximum()


@pytest.mark.ci
@settings(max_examples=100, deadline=None)
@given(EVENTS, st.integers(1, 4), st.integers(1, 3))
def test_no_owner_is_served_twice_while_another_could_be_served(events, total, per_owner):
    async def run() -> None:
        requests = Requests(total, per_owner)
        passed = {owner: Counter() for owner in OWNERS}
        for event, owner, place in events:
            due, start = requests.below_maximum(), len(requests.served)
            await (requests.arrive(owner) if event == "arrive" else getattr(requests, event)(place))
            requests.check_limits()
            served = requests.served[start:]
            for each in OWNERS:
                if each in due & requests.below_maximum() and each not in served:
                    passed[each].update(served)
                    assert max(passed[each].values(), default=0) <= 1
                else:
                    passed[each].clear()
        while requests.held:
            await requests.end(0)
        assert not requests.waiting

    asyncio.run(run())


def test_requests_of_one_owner_do_not_delay_those_of_another():
    async def run() -> None:
        requests = Requests(1, 1)
        for owner in "aaaaab":
            await requests.arrive(owner)
        for _ in range(3):
            await requests.end(0)
        assert requests.served == ["a", "a", "b", "a"]

    asyncio.run(run())


def test_an_owner_holds_no_more_than_its_share():
    async def run() -> None:
        requests = Requests(2, 1)
        for owner in "aab":
            await requests.arrive(owner)
        assert requests.served == ["a", "b"]

    asyncio.run(run())


@pytest.mark.parametrize("large", [2, 5, 16])
def test_small_requests_do_not_wait_for_the_end_of_large_ones(large):
    """As many large ones are in progress as leave room for another one; it waits for one of their ends."""

    async def run() -> None:
        requests = Requests(3 * large, 1)
        for owner in "abcd":
            await requests.arrive(owner, large)
        assert requests.served == ["a", "b"]
        for _ in range(3):
            await requests.arrive("e")
        assert requests.served == ["a", "b", "e"]
        for _ in range(6):
            await requests.end(0)
        assert sorted(requests.served) == ["a", "b", "c", "d", "e", "e", "e"]
        assert not requests.waiting

    asyncio.run(run())


@pytest.mark.parametrize("order", ["cancelled before it ends", "cancelled after it ended"])
def test_a_request_that_is_cancelled_in_its_turn_frees_the_slot(order):
    async def run() -> None:
        requests = Requests(1, 1)
        first = await requests.arrive("a")
        second = await requests.arrive("b")
        if order == "cancelled before it ends":
            second.cancel()
            requests.held[first][1].set()
        else:
            requests.held[first][1].set()
            await asyncio.sleep(0)
            await asyncio.sleep(0)
            second.cancel()
        await requests.settle()
        await requests.arrive("c")
        assert requests.served[-1] == "c"

    asyncio.run(run())


def test_reservations_of_an_owner_add_up_to_the_quota_at_most():
    admission = UploadAdmission(9)
    with admission.reserve("a", 0, 70, 20, 100) as first, admission.reserve("a", 0, 70, 20, 100) as second:
        assert (first, second) == (70, 10)
        with pytest.raises(QuotaError, match="delete some"), admission.reserve("a", 1, 1, 20, 100):
            pass
        with admission.reserve("b", 100, 100, 0, 100) as other:
            assert other == 100


@pytest.fixture
def executor() -> Iterator[BlockingExecutor]:
    opened = BlockingExecutor()
    yield opened
    opened.close()


def test_an_operation_has_the_context_of_its_request(executor: BlockingExecutor) -> None:
    """Log entries of an operation have the id of its request."""

    async def send(name: str) -> str:
        request_name.set(name)
        await asyncio.sleep(0)
        return await executor.run(request_name.get)

    async def send_all() -> list[str]:
        return await asyncio.gather(*(send(name) for name in "abc"))

    assert asyncio.run(send_all()) == ["a", "b", "c"]


def test_a_cancelled_request_waits_for_its_operation(executor: BlockingExecutor) -> None:
    """Files that the operation uses are closed only afterwards."""
    started, resume, ended = threading.Event(), threading.Event(), threading.Event()

    def operation() -> None:
        started.set()
        resume.wait(10.0)
        ended.set()

    async def cancel_request() -> None:
        request = asyncio.create_task(executor.run(operation))
        await asyncio.to_thread(started.wait, 10.0)
        request.cancel()
        await asyncio.sleep(0.05)
        assert not request.done()
        resume.set()
        with pytest.raises(asyncio.CancelledError):
            await request
        assert ended.is_set()

    asyncio.run(cancel_request())
