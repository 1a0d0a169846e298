"""Regressor matrix and Gram matrix over the rows of a record."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError
from islands.kernels import gram as gram_kernel
from islands.kernels import regressor_columns as column_kernel
from islands.kernels.interpreter import Program
from islands.kernels.regressor_columns import LANES, TIMES, Rows
from islands.kernels.simd import padded_size
from islands.program.term_pool import Term, link
from islands.records.dataset import Dataset


def regressor_matrix(terms: Sequence[Term], record: Dataset, warm_up: int) -> NDArray[np.float64]:
    """Return Psi transposed, shape (terms, rows): each term on every row after the warm-up of every segment.

    A term may be a canonical expression, which may have lag 0: the target y(k) is ``Lagged(0, 0)``.

    Raises
    ------
    RecordError
        If an output is missing, if no segment is longer than the warm-up, or if a term reads an input that
        the record does not have.
    SettingsError
        If the warm-up is shorter than the largest lag of the terms.
    """
    program = link(terms)
    _check_readable(program, record, warm_up)
    rows = select_rows(record, warm_up)
    out = np.empty((len(terms), rows.count))
    column_kernel.columns(program, rows, out)
    return out


def gram_matrix(terms: Sequence[Term], record: Dataset, warm_up: int) -> NDArray[np.float64]:
    """Return the inner products of all pairs of terms, shape (terms, terms), without storing the columns.

    Raises
    ------
    RecordError, SettingsError
        As in `regressor_matrix`.
    """
    program = link(terms)
    _check_readable(program, record, warm_up)
    out = np.empty((len(terms), len(terms)))
    gram_kernel.gram(program, select_rows(record, warm_up), out)
    return out


def _check_readable(program: Program, record: Dataset, warm_up: int) -> None:
    # The kernel has no bounds checks: it would read another signal, or memory outside the record.
    read = program.operands[program.operands[:, 0] >= 0]
    channel, lag = read.max(axis=0, initial=0)
    if channel > record.inputs:
        raise RecordError(f"the terms read input {channel}, the record has {record.inputs}")
    if lag > warm_up:
        raise SettingsError(f"the terms read {lag} samples back, the warm-up has {warm_up}")


# The rows of recent calls are kept: a selection estimates many models on few records, which never change.
@lru_cache(maxsize=8)
def select_rows(record: Dataset, warm_up: int) -> Rows:
    """Return the rows that are used for the estimation: those of every segment after its warm-up.

    Raises
    ------
    RecordError
        If an output is missing, or if no segment is longer than the warm-up.
    """
    missing = np.flatnonzero(np.isnan(record.y))
    if missing.size:
        raise RecordError(
            f"{record.output_name} is missing at sample {missing[0]}: estimation needs every sample, "
            "cut the record there and pass the parts as segments"
        )
    spans = [
        (begin + warm_up, end - begin - warm_up) for begin, end in record.bounds if end - begin > warm_up
    ]
    if not spans:
        raise RecordError(
            f"the longest recording has {max(record.segments)} samples and {warm_up} are needed before the "
            "first row: take a longer recording or smaller lags"
        )
    return arrange_rows(np.vstack([record.y, record.u.T]), spans, warm_up)


def arrange_rows(signals: NDArray[np.float64], spans: Sequence[tuple[int, int]], warm_up: int) -> Rows:
    """Arrange signals in chunks of times and lanes; see `Rows` for the layout.

    Parameters
    ----------
    signals : ndarray, shape (channel, sample)
    spans : sequence of pairs of int
        Sample of the first row and number of rows of every segment.
    warm_up : int
        Number of samples before each first row that may be read.
    """
    samples, chunks = [], []
    flat = count = 0
    for first, rows in spans:
        length = -(-rows // LANES)
        times = -(-length // TIMES) * TIMES
        time, lane = np.arange(times), np.arange(LANES)
        samples.append(first + np.arange(-warm_up, times)[:, None] + length * lane)
        begin = flat + (warm_up + time[::TIMES]) * LANES
        full = np.where(time < length, -(-(rows - time) // length), 0).reshape(-1, TIMES)
        chunks.append((begin, full, (count + time).reshape(-1, TIMES), np.full(begin.size, length)))
        flat, count = flat + (warm_up + times) * LANES, count + rows
    # Samples after the last row of a segment are read, but never counted.
    places = np.minimum(np.concatenate(samples), signals.shape[1] - 1).reshape(-1)
    gathered = padded_size(len(signals) * flat).reshape(-1, flat)
    gathered[:] = signals[:, places]
    offset, lanes, row, apart = (np.concatenate(parts) for parts in zip(*chunks, strict=True))
    return Rows(gathered, offset, lanes, row, apart, count)
