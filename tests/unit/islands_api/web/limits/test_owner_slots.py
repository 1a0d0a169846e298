"""Slots of owners: their limits, turns between owners, and cancelled requests."""

import asyncio
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from islands_api.web.limits.owner_slots import OwnerSlots

OWNERS = "abc"

#: An owner's request arrives; the request of a place among those that hold or wait ends or is cancelled.
EVENTS = st.lists(
    st.tuples(
        st.sampled_from(["arrive", "arrive", "end", "cancel"]), st.sampled_from(OWNERS), st.integers(0, 5)
    ),
    min_size=20,
    max_size=60,
)


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
