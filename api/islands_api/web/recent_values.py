"""Values that are kept in memory as long as they are in use."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from threading import Lock
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")


class RecentValues(Generic[K, V]):
    """Values that were used last, by keys that determine them, so that a request has the same answer without.

    Parameters
    ----------
    most : int
        Largest sum of the weights of the values. A value that weighs more is not kept.
    weigh : callable
        Returns the weight of a value; by default each has the weight 1.
    """

    def __init__(self, most: int, weigh: Callable[[V], int] = lambda _: 1) -> None:
        self._most, self._weigh = most, weigh
        self._weight = 0
        self._values: OrderedDict[K, V] = OrderedDict()
        self._lock = Lock()

    def get(self, key: K) -> V | None:
        """Return a value; None if it is not in memory."""
        with self._lock:
            if key in self._values:
                self._values.move_to_end(key)
            return self._values.get(key)

    def store(self, key: K, value: V) -> None:
        """Store a value; those that were not used for the longest time are removed if they weigh too much."""
        with self._lock:
            if self._weigh(value) > self._most:
                return
            if key in self._values:
                self._weight -= self._weigh(self._values.pop(key))
            self._values[key] = value
            self._weight += self._weigh(value)
            while self._weight > self._most:
                _, removed = self._values.popitem(last=False)
                self._weight -= self._weigh(removed)
