"""Hash table of inner products, keyed by pairs of terms: open addressing in two flat arrays.

The bits of an inner product do not depend on the other ones that are computed, so the table changes the time
of a computation, never its result.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.codegen import generate_program
from islands.kernels.gram import gram, inner_products
from islands.kernels.jit_cache import kernel

#: Key of a free place; no pair has it.
FREE = -1

#: Knuth's multiplicative hashing: 2^64 over the golden ratio, as a signed number.
_GOLDEN = np.int64(-7046029254386353131)


class Pairs(NamedTuple):
    """Hash table of inner products.

    Attributes
    ----------
    keys : ndarray of int64, shape (places,)
        Keys of pairs, or `FREE`; the number of places is a power of two.
    values : ndarray of float64, shape (places,)
        Inner products of the pairs.
    taken : ndarray of int64, shape (1,)
        Number of occupied places.
    """

    keys: NDArray[np.int64]
    values: NDArray[np.float64]
    taken: NDArray[np.int64]


@kernel
def pair_key(one, other):
    """Return the key of an unordered pair of terms."""
    return (min(one, other) << 32) | max(one, other)


@kernel(_nrt=False)
def find_pair(pairs, key):
    """Return the place of a key, or the free place where it belongs; at least one place must be free."""
    last = pairs.keys.size - 1
    place = ((key * _GOLDEN) >> 32) & last
    while pairs.keys[place] != FREE and pairs.keys[place] != key:
        place = (place + 1) & last
    return place


@kernel
def complete_pairs(
    structures,  # int64 [individual, most terms]
    sizes,  # int64 [individual]: number of terms
    target,  # the term y(k)
    nodes,
    pairs,  # updated
    rows,
):
    """Compute the inner products that the table lacks for some structures, each column once."""
    local = np.full(nodes.degree.size, -1, np.int64)
    terms = np.empty_like(local)
    most = 0
    for size in sizes:
        most += (size + 1) * (size + 2) // 2
    missing, places = np.empty((most, 2), np.int64), np.empty(most, np.int64)
    count = used = 0
    for index in range(sizes.size):
        size = sizes[index]
        for i in range(size + 1):
            one = structures[index, i] if i < size else target
            for j in range(i, size + 1):
                other = structures[index, j] if j < size else target
                key = pair_key(one, other)
                at = find_pair(pairs, key)
                if pairs.keys[at] == key:
                    continue
                pairs.keys[at] = key
                pairs.taken[0] += 1
                for term in (one, other):
                    if local[term] < 0:
                        local[term] = used
                        terms[used] = term
                        used += 1
                places[count] = at
                missing[count, 0], missing[count, 1] = local[one], local[other]
                count += 1
    if count == 0:
        return
    operand_index = np.full(nodes.operation.size, -1, np.int64)
    program = generate_program(nodes, terms[:used], operand_index)
    if count == used * (used + 1) // 2:
        products = np.empty((used, used))
        gram(program, rows, products)
        for index in range(count):
            pairs.values[places[index]] = products[missing[index, 0], missing[index, 1]]
        return
    numbers = np.empty(count)
    inner_products(program, rows, missing[:count], numbers)
    for index in range(count):
        pairs.values[places[index]] = numbers[index]


@kernel(_nrt=False)
def read_gram(terms, target, pairs, matrix):
    """Read the Gram matrix of the terms, the target last, from the table; return whether it is finite."""
    size = terms.size
    finite = True
    for i in range(size + 1):
        one = terms[i] if i < size else target
        for j in range(i, size + 1):
            other = terms[j] if j < size else target
            matrix[i, j] = pairs.values[find_pair(pairs, pair_key(one, other))]
            matrix[j, i] = matrix[i, j]
            finite &= np.isfinite(matrix[i, j])
    return finite


#: Bytes of one place: key and value.
PLACE_BYTES = 16


def pair_table(limit: int) -> Pairs:
    """Return an empty table: the largest power of two of places within ``limit`` bytes, at least 1024."""
    places = 1 << max(1024, limit // PLACE_BYTES).bit_length() - 1
    return Pairs(np.full(places, FREE), np.zeros(places), np.zeros(1, np.int64))


def clear(pairs: Pairs) -> None:
    """Empty a table."""
    pairs.keys[:] = FREE
    pairs.taken[0] = 0
