"""The regressor matrix and its Gram matrix over the rows of a record."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError
from islands.kernels import columns as column_kernel
from islands.kernels import gram as gram_kernel
from islands.model.expression import Expression
from islands.model.regressor import Regressor
from islands.program.linker import link

Term = Regressor | Expression


def regressor_matrix(terms: Sequence[Term], record: Dataset, warm_up: int) -> NDArray[np.float64]:
    """Return Psi transposed, shape (terms, rows): each term on every row of every segment after its warm-up.

    A term may be a bare canonical expression of lag 0 and more: the target y(k) is ``Lagged(0, 0)``.

    Raises
    ------
    RecordError
        An output is missing, or no segment is longer than the warm-up.
    """
    signals, first, rows = _rows(record, warm_up)
    out = np.empty((len(terms), int(rows.sum())))
    column_kernel.columns(link(terms), signals, first, rows, warm_up, out)
    return out


def gram_matrix(terms: Sequence[Term], record: Dataset, warm_up: int) -> NDArray[np.float64]:
    """Return the inner products of all pairs of terms, shape (terms, terms), without holding the columns.

    Raises
    ------
    RecordError
        As in `regressor_matrix`.
    """
    signals, first, rows = _rows(record, warm_up)
    out = np.empty((len(terms), len(terms)))
    gram_kernel.gram(link(terms), signals, first, rows, warm_up, out)
    return out


def _rows(record: Dataset, warm_up: int) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
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
    first, rows = np.array(spans, np.int64).T
    signals = np.ascontiguousarray(np.vstack([record.y, record.u.T]))
    return signals, np.ascontiguousarray(first), np.ascontiguousarray(rows)
