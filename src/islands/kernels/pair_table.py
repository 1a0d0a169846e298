"""A table of inner products, keyed by pairs of terms: open addressing in two flat arrays.

An inner product's bits do not depend on what was computed with it or before it, so the table changes how long
a result takes, never the result.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel

#: No pair has this key.
FREE = -1

#: Knuth's multiplicative hashing: 2^64 over the golden ratio, as a signed number.
_GOLDEN = np.int64(-7046029254386353131)


class Pairs(NamedTuple):
    """The table.

    Attributes
    ----------
    keys : ndarray of int64, shape (places,)
        Pairs, or `FREE`; a power of two of them.
    values : ndarray of float64, shape (places,)
        Their inner products.
    taken : ndarray of int64, shape (1,)
        How many places are taken.
    """

    keys: NDArray[np.int64]
    values: NDArray[np.float64]
    taken: NDArray[np.int64]


@kernel
def pair_key(one, other):
    """Return the key of an unordered pair of terms."""
    return (min(one, other) << 32) | max(one, other)


@kernel
def find_pair(pairs, key):
    """Return where a key stands, or the free place where it belongs; one place is always free."""
    last = pairs.keys.size - 1
    place = ((key * _GOLDEN) >> 32) & last
    while pairs.keys[place] != FREE and pairs.keys[place] != key:
        place = (place + 1) & last
    return place


#: Bytes of one place: key and number.
PLACE_BYTES = 16


def pair_table(limit: int) -> Pairs:
    """Return an empty table of as many places, a power of two, as fit into ``limit`` bytes; at least 1024."""
    places = 1 << max(1024, limit // PLACE_BYTES).bit_length() - 1
    return Pairs(np.full(places, FREE), np.zeros(places), np.zeros(1, np.int64))


def clear(pairs: Pairs) -> None:
    """Empty a table."""
    pairs.keys[:] = FREE
    pairs.taken[0] = 0
