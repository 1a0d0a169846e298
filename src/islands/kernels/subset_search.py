"""Search for the columns that explain a target best, by branch and bound on inner products.

The columns are the leaves of a binary tree that joins correlated columns, in such an order that a node of the
tree is a range of columns. A node of the search is a list of ranges, each with the number of columns that may
be chosen from it. Least squares on all columns of the ranges gives a lower bound of the error. The search
splits the largest range of the node with the lowest bound, and distributes the number of columns over the two
halves. If at most two columns are left to choose, the best ones are computed.

Branch and bound for subsets: Furnival and Wilson 1974. Their bound ignores the size of the subset, this one
does not.
"""

from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from islands.kernels.jit_cache import kernel

#: A smaller squared norm, relative to that of the column, is a rounding error of the inner products.
UNRESOLVED = 1e-13

#: An exchange must reduce the error by this fraction.
SAME = 1e-9

#: Multiplications of a node, on average; a search of larger nodes evaluates fewer.
MULTIPLICATIONS = 20_000


class Tree(NamedTuple):
    """Binary tree of columns; the last node is the root.

    Attributes
    ----------
    first, last : ndarray of int64, shape (nodes,)
        First column of the node, and the column after its last.
    left, right : ndarray of int64, shape (nodes,)
        The two halves of a node; -1 for a single column.
    """

    first: NDArray[np.int64]
    last: NDArray[np.int64]
    left: NDArray[np.int64]
    right: NDArray[np.int64]


class Scratch(NamedTuple):
    """Memory for the columns of one node.

    Attributes
    ----------
    columns : ndarray of int64, shape (columns,)
        The chosen columns, then those of the first and of the second open range.
    lower : ndarray of float64, shape (columns, columns)
        Cholesky factor of their inner products; rows of open columns have the pivots of the chosen ones only.
    left, correlation : ndarray of float64, shape (columns,)
        Squared norm of each column, and its inner product with the target, after orthogonalisation.
    pivot : ndarray of int64, shape (columns,)
        Positions of the independent columns.
    """

    columns: NDArray[np.int64]
    lower: NDArray[np.float64]
    left: NDArray[np.float64]
    correlation: NDArray[np.float64]
    pivot: NDArray[np.int64]


@kernel
def exchange(
    gram,  # float64 [column, column]: inner products of the columns, which have norm 1
    correlation,  # float64 [column]: inner products with the target, which has norm 1
    error,  # squared error of the subset, at most 1
    chosen,  # in and out, int64 [size]: distinct columns
):
    """Exchange pairs of columns for better ones until no exchange reduces the error; return the error."""
    count, size = correlation.size, chosen.size
    scratch = _allocate(count)
    changed = size >= 2
    while changed:
        changed = False
        for one in range(size):
            for other in range(one + 1, size):
                fixed = 0
                taken = np.zeros(count, np.bool_)
                for place in range(size):
                    if place not in (one, other):
                        scratch.columns[fixed] = chosen[place]
                        taken[chosen[place]] = True
                        fixed += 1
                columns = fixed
                for column in range(count):
                    if not taken[column]:
                        scratch.columns[columns] = column
                        columns += 1
                explained, rank = _explain(gram, correlation, scratch, fixed, count)
                gain, first, second = _complete(gram, scratch, rank, fixed, fixed, count, 2)
                found = max(0.0, 1.0 - explained - gain)
                if second >= 0 and found < error * (1.0 - SAME):
                    error = found
                    chosen[one], chosen[other] = scratch.columns[first], scratch.columns[second]
                    changed = True
    return error


@kernel
def search(
    gram,  # float64 [column, column]: inner products of the columns, which have norm 1
    correlation,  # float64 [column]: inner products with the target, which has norm 1
    tree,
    size,  # number of columns to choose
    limit,  # evaluate at most this number of nodes, apart from the root, of average size
    error,  # squared error of a known subset, at most 1
    chosen,  # out, int64 [size]: columns of a better subset, -1 after the last; unchanged if there is none
):
    """Return a lower bound of the squared error of all subsets, the error of the best one, and the nodes."""
    count = correlation.size
    scratch = _allocate(count)
    ranges, shares = np.full((limit + 2, size), -1), np.zeros((limit + 2, size), np.int64)
    ranges[0, 0], shares[0, 0] = tree.first.size - 1, size
    bound, exact, work = _evaluate(gram, correlation, tree, ranges[0], shares[0], scratch, error, chosen)
    if exact:
        return min(bound, error), min(bound, error), 0
    open_nodes = [(bound, 0)]
    used, nodes, most = 1, 0, limit * MULTIPLICATIONS
    while len(open_nodes) > 0 and open_nodes[0][0] < error and nodes + size + 1 <= limit and work <= most:
        least, index = heappop(open_nodes)
        split, largest = 0, 0
        for place in range(size):
            node = ranges[index, place]
            if node >= 0:
                width = tree.last[node] - tree.first[node]
                if width > shares[index, place] and width > largest:
                    split, largest = place, width
        node, total = ranges[index, split], shares[index, split]
        for some in range(total + 1):
            one, other = tree.left[node], tree.right[node]
            if some > tree.last[one] - tree.first[one] or total - some > tree.last[other] - tree.first[other]:
                continue
            _divide(ranges, shares, index, used, split, one, some, other)
            nodes += 1
            bound, exact, added = _evaluate(
                gram, correlation, tree, ranges[used], shares[used], scratch, error, chosen
            )
            work += added
            if exact:
                error = min(bound, error)
            elif bound < error:
                heappush(open_nodes, (max(bound, least), used))
                used += 1
    return min(error, open_nodes[0][0]) if len(open_nodes) > 0 else error, error, nodes


@kernel
def _allocate(count):
    return Scratch(
        np.empty(count, np.int64),
        np.empty((count, count)),
        np.empty(count),
        np.empty(count),
        np.empty(count, np.int64),
    )


@kernel(_nrt=False)
def _divide(ranges, shares, parent, child, split, one, some, other):
    """Write a child: the ranges of its parent, with one range divided into two halves."""
    ranges[child] = -1
    place = 0
    for each in range(ranges.shape[1]):
        if each != split and ranges[parent, each] >= 0:
            ranges[child, place], shares[child, place] = ranges[parent, each], shares[parent, each]
            place += 1
    rest = shares[parent, split] - some
    if some > 0:
        ranges[child, place], shares[child, place] = one, some
        place += 1
    if rest > 0:
        ranges[child, place], shares[child, place] = other, rest


@kernel(_nrt=False)
def _evaluate(gram, correlation, tree, ranges, shares, scratch, error, chosen):
    """Return the lower bound of a node, or the error of its best subset; whether it is the error; the work.

    Write that subset to ``chosen`` if its error is less than ``error``.
    """
    fixed = columns = 0
    for complete in (True, False):
        for place in range(ranges.size):
            node = ranges[place]
            if node < 0:
                continue
            first, last = tree.first[node], tree.last[node]
            if (last - first <= shares[place]) == complete:
                for column in range(first, last):
                    scratch.columns[columns] = column
                    columns += 1
        if complete:
            fixed = columns
    left_to_choose = split = 0
    for place in range(ranges.size):
        node = ranges[place]
        if node >= 0 and tree.last[node] - tree.first[node] > shares[place]:
            left_to_choose += shares[place]
            if split == 0:
                split = fixed + tree.last[node] - tree.first[node]
    if left_to_choose > 2:
        explained, rank = _explain(gram, correlation, scratch, columns, columns)
        return max(0.0, 1.0 - explained), False, columns**3 // 6
    explained, rank = _explain(gram, correlation, scratch, fixed, columns)
    if left_to_choose == 2 and split == columns:
        split = fixed  # both columns come from one range
    gain, one, other = _complete(gram, scratch, rank, fixed, split, columns, left_to_choose)
    best = max(0.0, 1.0 - explained - gain)
    if best < error:
        for place in range(chosen.size):
            chosen[place] = scratch.columns[place] if place < fixed else -1
        if one >= 0:
            chosen[fixed] = scratch.columns[one]
        if other >= 0:
            chosen[fixed + 1] = scratch.columns[other]
    return best, True, columns**2 * (fixed + 1) // 2


@kernel(_nrt=False)
def _explain(gram, correlation, scratch, fixed, columns):
    """Orthogonalise the columns against the first ``fixed`` ones.

    Return the squares that these explain, and the number of independent ones.
    """
    lower, pivot = scratch.lower, scratch.pivot
    rank, explained = 0, 0.0
    for row in range(columns):
        column = scratch.columns[row]
        left, product = 1.0, correlation[column]
        for k in range(rank):
            value = gram[column, scratch.columns[pivot[k]]]
            for earlier in range(k):
                value -= lower[row, earlier] * lower[pivot[k], earlier]
            value /= lower[pivot[k], k]
            lower[row, k] = value
            left -= value * value
            product -= value * scratch.correlation[pivot[k]]
        scratch.left[row], scratch.correlation[row] = left, product
        if row < fixed and left > UNRESOLVED:
            lower[row, rank] = np.sqrt(left)
            scratch.correlation[row] = product / lower[row, rank]
            explained += scratch.correlation[row] ** 2
            pivot[rank] = row
            rank += 1
    return explained, rank


@kernel(_nrt=False)
def _complete(gram, scratch, rank, fixed, split, columns, number):
    """Return the largest squares that one or two more columns explain, and their positions.

    Two columns come from either side of ``split``, or both from the open columns if it equals ``fixed``.
    """
    left, correlation, lower = scratch.left, scratch.correlation, scratch.lower
    best, one, other = 0.0, -1, -1
    if number == 0:
        return best, one, other
    for i in range(fixed, columns):
        if left[i] > UNRESOLVED:
            alone = correlation[i] ** 2 / left[i]
            if alone > best:
                best, one, other = alone, i, -1
            if number == 2 and (split == fixed or i < split):
                for j in range(max(i + 1, split), columns):
                    shared = gram[scratch.columns[i], scratch.columns[j]]
                    for k in range(rank):
                        shared -= lower[i, k] * lower[j, k]
                    rest = left[j] - shared * shared / left[i]
                    if rest > UNRESOLVED:
                        product = correlation[j] - shared / left[i] * correlation[i]
                        both = alone + product * product / rest
                        if both > best:
                            best, one, other = both, i, j
    return best, one, other
