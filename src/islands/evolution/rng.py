"""Derived random streams: seed, island, generation and purpose determine every random number."""

from collections.abc import Sequence
from enum import IntEnum
from typing import TypeVar

import numpy as np
from numpy.random import RandomState, SeedSequence
from numpy.typing import NDArray

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

    All draws use ``RandomState.random_sample``, whose sequence is guaranteed to be equal in all versions of
    NumPy. It is that of ``random.Random`` with the words as one integer, the least significant first.
    """

    __slots__ = ("_uniform",)

    def __init__(self, seed: int, island: int, generation: int, purpose: Purpose) -> None:
        words = SeedSequence(seed, spawn_key=(island, generation, int(purpose))).generate_state(4)
        # An integer has no leading zeros.
        self._uniform = RandomState(np.trim_zeros(words, "b")).random_sample

    def draw(self, count: int) -> NDArray[np.float64]:
        """Return random numbers in [0, 1)."""
        return self._uniform(count)

    def chance(self, probability: float) -> bool:
        """Return true with a probability."""
        return self._uniform() < probability

    def randrange(self, bound: int) -> int:
        """Return a random integer from 0 to ``bound - 1``."""
        return int(self._uniform() * bound)

    def choice(self, items: Sequence[T]) -> T:
        """Return a random element of a sequence."""
        return items[int(self._uniform() * len(items))]
