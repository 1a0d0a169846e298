"""Blocks of consecutive samples: resampling of sums for the uncertainty of a fact."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

#: Blocks of a record, and resamples of them.
BLOCKS, RESAMPLES = 32, 400


def assign_blocks(samples: int) -> NDArray[np.int64]:
    """Return the block of every sample, shape (samples,); blocks have equal lengths within one sample."""
    return np.arange(samples) * BLOCKS // samples


def sum_blocks(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sums of the values in every block, shape (BLOCKS,)."""
    sums: NDArray[np.float64] = np.bincount(assign_blocks(len(values)), values, BLOCKS).astype(np.float64)
    return sums


@cache
def draw_weights() -> NDArray[np.float64]:
    """Return how often every block occurs in every resample, shape (BLOCKS, RESAMPLES).

    The draw is fixed, so that equal records have equal facts.
    """
    drawn = np.random.default_rng(0).multinomial(BLOCKS, np.full(BLOCKS, 1.0 / BLOCKS), RESAMPLES)
    return np.ascontiguousarray(drawn.T, dtype=np.float64)


def resample(sums: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the totals of block sums (..., BLOCKS) in every resample, shape (..., RESAMPLES)."""
    # Unlike a matrix product, the sums of einsum do not depend on the number of threads.
    totals: NDArray[np.float64] = np.einsum("...b,br->...r", sums, draw_weights())
    return totals
