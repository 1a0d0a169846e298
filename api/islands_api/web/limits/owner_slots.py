"""Slots for work that takes a core or much memory, shared fairly between owners."""

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager


class OwnerSlots:
    """Pool of slots.

    Waiting owners are served in turn, and the requests of one owner in the order of their arrival. While an
    owner waits that holds fewer slots than it may, every other owner is served at most once.

    Parameters
    ----------
    total : int
        Number of slots.
    per_owner : int
        Maximum number of slots that one owner holds.
    """

    def __init__(self, total: int, per_owner: int) -> None:
        self._free, self._per_owner = total, per_owner
        self._held: Counter[str] = Counter()
        self._waiting: OrderedDict[str, deque[asyncio.Future[None]]] = OrderedDict()

    @asynccontextmanager
    async def hold(self, owner: str) -> AsyncIterator[None]:
        """Hold a slot during the block; wait for it first."""
        turn = asyncio.get_running_loop().create_future()
        self._waiting.setdefault(owner, deque()).append(turn)
        self._serve()
        try:
            await turn
        except asyncio.CancelledError:
            if turn.cancelled():
                self._forget(owner, turn)
            else:  # served and cancelled before this task could continue
                self._release(owner)
            raise
        try:
            yield
        finally:
            self._release(owner)

    def _serve(self) -> None:
        """Give the free slots to waiting requests."""
        while self._free:
            owner = next((each for each in self._waiting if self._held[each] < self._per_owner), None)
            if owner is None:
                return
            turn = self._waiting[owner][0]
            self._forget(owner, turn)
            if turn.done():  # cancelled, which its task has not noticed yet
                continue
            if owner in self._waiting:
                self._waiting.move_to_end(owner)
            self._free -= 1
            self._held[owner] += 1
            turn.set_result(None)

    def _forget(self, owner: str, turn: asyncio.Future[None]) -> None:
        turns = self._waiting.get(owner, deque())
        if turn in turns:
            turns.remove(turn)
        if not turns:
            self._waiting.pop(owner, None)

    def _release(self, owner: str) -> None:
        self._free += 1
        self._held[owner] -= 1
        self._held += Counter()  # drops owners without a slot
        self._serve()
