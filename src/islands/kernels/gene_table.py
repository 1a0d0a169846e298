"""Hash table of genes in prefix code: a gene is the number of a sequence of symbols.

A symbol is a node without its arguments, such as ``mul``, ``q2`` or ``u1(k-1)``; its number of arguments
determines where a subtree ends. The table is a cache: the numbers follow the order of insertion, and no
result may depend on them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel

#: Mark of a free place of the hash table.
FREE = -1

#: Returned in place of a gene for which the table has no room.
NO_ROOM = -1

#: Property of a gene that is not computed yet.
UNKNOWN = -2

#: Knuth's multiplicative hashing: 2^64 over the golden ratio, as a signed number.
_GOLDEN = np.int64(-7046029254386353131)


class GeneTable(NamedTuple):
    """Genes and their properties.

    Attributes
    ----------
    symbols : ndarray of int64, shape (room for symbols,)
        Codes of all genes, one after the other.
    start : ndarray of int64, shape (room for genes + 1,)
        Begin of the code of each gene, and the end of the last.
    taken : ndarray of int64, shape (1,)
        Number of genes.
    places : ndarray of int64, shape (places,)
        Hash table of genes, or `FREE`; the number of places is a power of two.
    arity : ndarray of int64, shape (room for symbols,)
        Number of arguments of each symbol.
    repaired : ndarray of int64, shape (room for genes,)
        The gene that the structure of the search makes of a gene, or `UNKNOWN`.
    term : ndarray of int64, shape (room for genes,)
        Number of the regressor, or `UNKNOWN`.
    meets : ndarray of bool, shape (room for genes, requirements)
        Whether a gene meets a requirement on the genes of an individual.
    """

    symbols: NDArray[np.int64]
    start: NDArray[np.int64]
    taken: NDArray[np.int64]
    places: NDArray[np.int64]
    arity: NDArray[np.int64]
    repaired: NDArray[np.int64]
    term: NDArray[np.int64]
    meets: NDArray[np.bool_]


def empty_table(genes: int, arity: NDArray[np.int64], requirements: int) -> GeneTable:
    """Return a table with room for a number of genes, a power of two, with eight symbols each on average."""
    return GeneTable(
        np.empty(8 * genes, np.int64),
        np.zeros(genes + 1, np.int64),
        np.zeros(1, np.int64),
        np.full(2 * genes, FREE, np.int64),
        arity,
        np.full(genes, UNKNOWN),
        np.full(genes, UNKNOWN),
        np.zeros((genes, requirements), np.bool_),
    )


@kernel(_nrt=False)
def number_code(code, table):
    """Return the gene with a code, which is added if it is new, or `NO_ROOM`."""
    hashed = np.int64(code.size)
    for symbol in code:
        hashed = (hashed ^ symbol) * _GOLDEN
        hashed ^= hashed >> 32
    last = table.places.size - 1
    place = hashed & last
    while table.places[place] != FREE:
        gene = table.places[place]
        begin = table.start[gene]
        equal = table.start[gene + 1] - begin == code.size
        offset = 0
        while equal and offset < code.size:
            equal = table.symbols[begin + offset] == code[offset]
            offset += 1
        if equal:
            return gene
        place = (place + 1) & last
    gene = table.taken[0]
    begin = table.start[gene]
    if gene == table.repaired.size or begin + code.size > table.symbols.size:
        return np.int64(NO_ROOM)
    for offset in range(code.size):
        table.symbols[begin + offset] = code[offset]
    table.start[gene + 1] = begin + code.size
    table.places[place] = gene
    table.taken[0] += 1
    return gene


@kernel(_nrt=False)
def find_end(symbols, begin, arity):
    """Return the end of the subtree that begins at a position."""
    missing = 1
    while missing > 0:
        missing += arity[symbols[begin]] - 1
        begin += 1
    return begin


@kernel
def measure_height(code, arity):
    """Return the number of edges from the root to the deepest leaf."""
    heights = np.empty(code.size, np.int64)
    count = 0
    for place in range(code.size - 1, -1, -1):
        highest = -1
        for _ in range(arity[code[place]]):
            count -= 1
            highest = max(highest, heights[count])
        heights[count] = highest + 1
        count += 1
    return heights[0]
