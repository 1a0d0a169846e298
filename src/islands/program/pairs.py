"""Room for a table of inner products."""

import numpy as np

from islands.kernels.pairs import FREE, Pairs

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
