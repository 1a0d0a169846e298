"""Inner products of columns, computed chunk by chunk without storing the columns of the whole record.

The regressor matrix of a large library does not fit into memory (80 730 candidates of the paper's appendix on
100 000 rows: 65 GB). Selection and least squares need only the inner products.

All sums have the fixed order of `islands.kernels.summation` over the chunks of `Rows`. An inner product does
not depend on the other ones that are computed with it, nor on whether all pairs or only some are requested.
"""

from islands.kernels.jit_cache import kernel
from islands.kernels.regressor_columns import allocate_arena, evaluate
from islands.kernels.simd import (
    VECTOR,
    add,
    broadcast,
    fold,
    gather,
    load,
    multiply,
    outer,
    outer_upper,
    padded_size,
    repeat,
    store,
)
from islands.kernels.summation import CHUNK

#: Bytes of running sums per pass over the record; more sums take another pass.
_PASS_BYTES = 1 << 26

#: Groups of four pairs per pass.
_GROUPS = _PASS_BYTES // (4 * 8 * VECTOR)

#: Tiles of four terms times four per pass.
_TILES = _PASS_BYTES // (16 * 8 * VECTOR)


@kernel
def inner_products(
    program,
    rows,
    pairs,  # int64 [pair, 2]: the terms of each pair; fast if four neighbours share the first term
    out,  # out, float64 [pair]
):
    """Compute the inner products of some pairs of terms."""
    arena, place = allocate_arena(program)
    chunk = padded_size(program.degree.size * CHUNK)
    for begin in range(0, pairs.shape[0], 4 * _GROUPS):
        some = pairs[begin : begin + 4 * _GROUPS]
        running = padded_size(4 * VECTOR * -(-some.shape[0] // 4))
        running[:] = 0.0
        for index in range(rows.offset.size):
            evaluate(program, rows, index, arena, place, chunk)
            _add_pairs(chunk, some, running)
        for pair in range(some.shape[0]):
            out[begin + pair] = fold(load(running, VECTOR * pair, 1))


@kernel
def gram(
    program,
    rows,
    out,  # out, float64 [term, term]
):
    """Compute the inner products of all pairs of terms."""
    terms = program.degree.size
    blocks = -(-terms // 4)
    arena, place = allocate_arena(program)
    chunk = padded_size(4 * blocks * CHUNK)
    chunk[:] = 0.0  # also after the last term
    tiles = blocks * (blocks + 1) // 2
    for begin in range(0, tiles, _TILES):
        end = min(tiles, begin + _TILES)
        running = padded_size(16 * VECTOR * (end - begin))
        running[:] = 0.0
        for index in range(rows.offset.size):
            evaluate(program, rows, index, arena, place, chunk)
            add_tiles(chunk, blocks, begin, end, running)
        read_tiles(running, blocks, begin, end, terms, out)


@kernel
def gram_of_residual(
    jacobian,  # float64 [term, row]
    residual,  # float64 [row]
    first,
    last,
    out,  # out, float64 [term + 1, term + 1]; the residual is the last term
):
    """Compute the inner products of all pairs of given columns over the rows ``first`` to ``last - 1``."""
    terms = jacobian.shape[0]
    blocks = -(-(terms + 1) // 4)
    tiles = blocks * (blocks + 1) // 2
    chunk = padded_size(4 * blocks * CHUNK)
    chunk[:] = 0.0
    running = padded_size(16 * VECTOR * tiles)
    running[:] = 0.0
    for begin in range(first, last, CHUNK):
        rows = min(CHUNK, last - begin)
        if rows < CHUNK:
            chunk[:] = 0.0
        for term in range(terms):
            chunk[term * CHUNK : term * CHUNK + rows] = jacobian[term, begin : begin + rows]
        chunk[terms * CHUNK : terms * CHUNK + rows] = residual[begin : begin + rows]
        add_tiles(chunk, blocks, 0, tiles, running)
    read_tiles(running, blocks, 0, tiles, terms + 1, out)


@kernel(_nrt=False)
def _add_pairs(chunk, pairs, running):
    """Add the products of a chunk of rows to the running sums of every pair, four pairs at a time."""
    last = pairs.shape[0] - 1
    for pair in range(0, last + 1, 4):
        a, b, c, d = pair, min(pair + 1, last), min(pair + 2, last), min(pair + 3, last)
        i, j, k, m = pairs[a, 0] * CHUNK, pairs[b, 0] * CHUNK, pairs[c, 0] * CHUNK, pairs[d, 0] * CHUNK
        p, q, r, s = pairs[a, 1] * CHUNK, pairs[b, 1] * CHUNK, pairs[c, 1] * CHUNK, pairs[d, 1] * CHUNK
        sums = broadcast(0.0, 4)
        if i == j == k == m:
            for row in range(0, CHUNK, VECTOR):
                others = gather(chunk, p + row, q + row, r + row, s + row)
                sums = add(sums, multiply(repeat(load(chunk, i + row, 1)), others))
        else:
            for row in range(0, CHUNK, VECTOR):
                ones = gather(chunk, i + row, j + row, k + row, m + row)
                sums = add(sums, multiply(ones, gather(chunk, p + row, q + row, r + row, s + row)))
        store(running, VECTOR * pair, add(load(running, VECTOR * pair, 4), sums))


@kernel(_nrt=False)
def add_tiles(chunk, blocks, begin, end, running):
    """Add the products of a chunk of rows to the running sums of some tiles, four terms times four."""
    tile = 0
    for one in range(blocks):
        i = 4 * one * CHUNK
        for other in range(one, blocks):
            if begin <= tile < end:
                at = 16 * VECTOR * (tile - begin)
                if one == other:
                    upper = broadcast(0.0, 10)
                    for row in range(i, i + CHUNK, VECTOR):
                        x = gather(chunk, row, row + CHUNK, row + 2 * CHUNK, row + 3 * CHUNK)
                        upper = add(upper, outer_upper(x))
                    store(running, at, add(load(running, at, 10), upper))
                else:
                    apart = 4 * (other - one) * CHUNK
                    whole = broadcast(0.0, 16)
                    for row in range(i, i + CHUNK, VECTOR):
                        x = gather(chunk, row, row + CHUNK, row + 2 * CHUNK, row + 3 * CHUNK)
                        there = row + apart
                        y = gather(chunk, there, there + CHUNK, there + 2 * CHUNK, there + 3 * CHUNK)
                        whole = add(whole, outer(x, y))
                    store(running, at, add(load(running, at, 16), whole))
            tile += 1


@kernel(_nrt=False)
def read_tiles(running, blocks, begin, end, terms, out):
    """Fold the running sums of some tiles and write both halves of the symmetric matrix."""
    tile = 0
    for one in range(blocks):
        for other in range(one, blocks):
            if begin <= tile < end:
                at = 16 * VECTOR * (tile - begin)
                for i in range(4 * one, 4 * one + 4):
                    for j in range(max(i, 4 * other), 4 * other + 4):
                        if j < terms:
                            out[i, j] = fold(load(running, at, 1))
                            out[j, i] = out[i, j]
                        at += VECTOR
            tile += 1
