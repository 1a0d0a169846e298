"""Slots for work that takes a core or much memory, shared fairly between owners."""

import asyncio
from collections import Counter, OrderedDict, deque
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field


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
