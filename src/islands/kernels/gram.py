"""Inner products of pairs of columns, without ever holding the columns of the whole record.

The regressor matrix of a large library does not fit into memory (80 730 candidates of the paper's appendix on
100 000 rows: 65 GB). Inner products are numbers, and selection and least squares need nothing else.
"""

import numpy as np

from islands.kernels.columns import arena_for, evaluate
from islands.kernels.compilation import kernel
from islands.kernels.lanes import VECTOR, add, fold, half, load, multiply, room, splat, store
from islands.kernels.sums import CHUNK, COUNT, dot_chunk

#: Pairs whose running sums are held at a time, 64 bytes each; more take another pass over the record.
_AT_A_TIME = 1 << 20


@kernel
def inner_products(
    program,
    rows,
    pairs,  # int64 [pair, 2]: the terms of each pair; quick where neighbours share the first
    out,  # out, float64 [pair]
):
    """Compute inner products over all rows in the written order of `sums`, begun anew in every segment.

    A pair's number does not depend on which other terms and pairs are computed with it.
    """
    arena, place = arena_for(program, rows)
    chunk = room(program.degree.size * CHUNK)
    running = room(VECTOR * min(_AT_A_TIME, pairs.shape[0]))
    for begin in range(0, pairs.shape[0], _AT_A_TIME):
        batch = pairs[begin : begin + _AT_A_TIME]
        running[:] = 0.0
        for segment in range(rows.first.size):
            for done in range(0, rows.rows[segment], CHUNK):
                lanes = min(CHUNK, rows.rows[segment] - done)
                evaluate(program, rows, rows.first[segment] + done, lanes, arena, place, chunk)
                _add_products(chunk, batch, running)
        for pair in range(batch.shape[0]):
            out[begin + pair] = fold(load(running, np.uint64(VECTOR * pair), 1))


@kernel
def _add_products(chunk, pairs, running):
    """Add the products of a chunk of rows to the running sums of every pair."""
    pair, count = 0, pairs.shape[0]
    while pair < count:
        one = np.uint64(pairs[pair, 0] * CHUNK)
        at = np.uint64(VECTOR * pair)
        if (
            pair + 3 < count
            and pairs[pair, 0] == pairs[pair + 3, 0] == pairs[pair + 1, 0] == pairs[pair + 2, 0]
        ):
            # Four at once: what they share is read once.
            others = (
                np.uint64(pairs[pair, 1] * CHUNK),
                np.uint64(pairs[pair + 1, 1] * CHUNK),
                np.uint64(pairs[pair + 2, 1] * CHUNK),
                np.uint64(pairs[pair + 3, 1] * CHUNK),
            )
            a, b, c, d = splat(0.0, COUNT), splat(0.0, COUNT), splat(0.0, COUNT), splat(0.0, COUNT)
            for group in range(0, CHUNK, VECTOR * COUNT):
                step = np.uint64(group)
                x = load(chunk, one + step, COUNT)
                a = add(a, multiply(x, load(chunk, others[0] + step, COUNT)))
                b = add(b, multiply(x, load(chunk, others[1] + step, COUNT)))
                c = add(c, multiply(x, load(chunk, others[2] + step, COUNT)))
                d = add(d, multiply(x, load(chunk, others[3] + step, COUNT)))
            store(running, at, add(load(running, at, 1), half(half(a))))
            store(
                running, at + np.uint64(VECTOR), add(load(running, at + np.uint64(VECTOR), 1), half(half(b)))
            )
            store(
                running,
                at + np.uint64(2 * VECTOR),
                add(load(running, at + np.uint64(2 * VECTOR), 1), half(half(c))),
            )
            store(
                running,
                at + np.uint64(3 * VECTOR),
                add(load(running, at + np.uint64(3 * VECTOR), 1), half(half(d))),
            )
            pair += 4
        else:
            other = np.uint64(pairs[pair, 1] * CHUNK)
            store(running, at, add(load(running, at, 1), dot_chunk(chunk, one, chunk, other)))
            pair += 1
