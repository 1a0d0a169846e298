"""Derived random streams: seed, island, generation and purpose determine every random number."""

from collections.abc import Sequence
from enum import IntEnum
from random import Random
from typing import TypeVar

import numpy as np
from numpy.random import SeedSequence
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

    All draws have the sequence of ``Random.random``, which is guaranteed to be equal in all Python versions.
    """

    __slots__ = ("_bits", "_uniform")

    def __init__(self, seed: int, island: int, generation: int, purpose: Purpose) -> None:
        words = SeedSequence(seed, spawn_key=(island, generation, int(purpose))).generate_state(4)
        random = Random(int.from_bytes(words.tobytes(), "little"))
        self._uniform, self._bits = random.random, random.getrandbits

    def draw(self, count: int) -> NDArray[np.float64]:
        """Return random numbers in [0, 1)."""
        # Random.random takes 27 and 26 bits of two words of the generator.
        words = np.frombuffer(self._bits(64 * count).to_bytes(8 * count, "little"), "<u4")
        high, low = words[::2] >> 5, words[1::2] >> 6
        return (high * 2.0**26 + low) / 2.0**53

    def chance(self, probability: float) -> bool:
        """Return true with a probability."""
        return self._uniform() < probability

    def randrange(self, bound: int) -> int:
        """Return a random integer from 0 to ``bound - 1``."""
        return int(self._uniform() * bound)

    def choice(self, items: Sequence[T]) -> T:
        """Return a random element of a sequence."""
        return items[int(self._uniform() * len(items))]
