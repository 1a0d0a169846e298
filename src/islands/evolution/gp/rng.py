"""Random numbers that are derived, never stored: the same place in a run always draws the same ones."""

from collections.abc import Sequence
from enum import IntEnum
from random import Random
from typing import TypeVar

from numpy.random import SeedSequence

T = TypeVar("T")


class Purpose(IntEnum):
    """What a stream is for. The numbers are part of every result: append, never reorder."""

    INITIAL = 0
    SELECTION = 1
    VARIATION = 2
    PRUNING = 3
    EMIGRATION = 4
    IMMIGRATION = 5
    TOPOLOGY = 6


class Stream:
    """A stream of draws for one purpose of one generation of one island.

    Only ``Random.random`` is used underneath: its sequence is guaranteed from one Python to the next.
    """

    __slots__ = ("_uniform",)

    def __init__(self, seed: int, island: int, generation: int, purpose: Purpose) -> None:
        words = SeedSequence(seed, spawn_key=(island, generation, int(purpose))).generate_state(4)
        self._uniform = Random(int.from_bytes(words.tobytes(), "little")).random

    def chance(self, probability: float) -> bool:
        """Draw true with a probability."""
        return self._uniform() < probability

    def randrange(self, bound: int) -> int:
        """Draw a whole number from 0 to ``bound - 1``."""
        return int(self._uniform() * bound)

    def choice(self, items: Sequence[T]) -> T:
        """Draw one of the items."""
        return items[int(self._uniform() * len(items))]
