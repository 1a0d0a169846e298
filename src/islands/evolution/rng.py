"""Derived random streams: seed, island, generation and purpose determine every random number."""

from collections.abc import Sequence
from enum import IntEnum
from random import Random
from typing import TypeVar

from numpy.random import SeedSequence

T = TypeVar("T")


class Purpose(IntEnum):
    """Purpose of a stream. The numbers affect every result: append new ones, never reorder them."""

    INITIAL = 0
    SELECTION = 1
    VARIATION = 2
    PRUNING = 3
    EMIGRATION = 4
    IMMIGRATION = 5
    TOPOLOGY = 6


class Stream:
    """Random stream for one purpose, generation and island.

    All draws use ``Random.random``, whose sequence is guaranteed to be equal in all Python versions.
    """

    __slots__ = ("_uniform",)

    def __init__(self, seed: int, island: int, generation: int, purpose: Purpose) -> None:
        words = SeedSequence(seed, spawn_key=(island, generation, int(purpose))).generate_state(4)
        self._uniform = Random(int.from_bytes(words.tobytes(), "little")).random

    def chance(self, probability: float) -> bool:
        """Return true with a probability."""
        return self._uniform() < probability

    def randrange(self, bound: int) -> int:
        """Return a random integer from 0 to ``bound - 1``."""
        return int(self._uniform() * bound)

    def choice(self, items: Sequence[T]) -> T:
        """Return a random element of a sequence."""
        return items[int(self._uniform() * len(items))]
