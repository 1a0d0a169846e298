"""Cut a record into shooting intervals and lay them out for the kernel as [block][time][lane]."""

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.kernels.simulate import Layout

#: Most lanes of a block: its rows of 832 bytes keep the history of a model inside the first-level cache.
WIDTH = 104


def layout(record: Dataset, warm_up: int, interval: int | None = None) -> Layout:
    """Lay out a record for a simulation.

    Parameters
    ----------
    warm_up : int
        Measured samples before the first prediction of every segment, and before every interval.
    interval : int or None
        Samples of a shooting interval: 1 is one-step-ahead, None is the free run over each whole segment. The
        last, shorter interval of a segment counts as well.

    Raises
    ------
    RecordError
        No segment is longer than the warm-up, or the output is missing where an interval starts from it.
    SettingsError
        The interval is under 1.
    """
    if interval is not None and interval < 1:
        raise SettingsError(f"a shooting interval has at least 1 sample, got {interval}")
    start, length = _intervals(record, warm_up, interval)
    _check_warm_up(record.y, start, warm_up)
    signals = np.ascontiguousarray(np.vstack([record.y, record.u.T]))
    cuts = np.arange(0, len(start), WIDTH)
    if interval == 1:
        # One step ahead needs no gathering: neighbouring lanes are neighbouring samples of one segment.
        cuts = np.union1d(cuts, np.flatnonzero(np.diff(start) != 1) + 1)
        lanes = np.diff(np.append(cuts, len(start)))
        return Layout(signals, start[cuts] - warm_up, lanes, 1, start, length, int(lanes.max()), warm_up)
    order = np.argsort(-length, kind="stable")
    start, length = start[order], length[order]
    lanes = np.diff(np.append(cuts, len(start)))
    width = int(lanes.max())
    rows = warm_up + length[cuts]
    offset = width * (np.cumsum(rows) - rows)
    gathered = np.zeros((len(signals), int(rows.sum()) * width))
    for cut, count, at, steps in zip(cuts, lanes, offset, rows, strict=True):
        samples = start[cut : cut + count] - warm_up + np.arange(steps)[:, None]
        block = gathered[:, at : at + steps * width].reshape(len(signals), steps, width)
        # A short lane ends before the block does; what stands behind its end is never read.
        block[:, :, :count] = signals[:, np.minimum(samples, record.samples - 1)]
    return Layout(gathered, offset, lanes, width, start, length, width, warm_up)


def _intervals(
    record: Dataset, warm_up: int, interval: int | None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return first sample and length of every interval, in the order of time."""
    pairs = [
        (start, min(interval or record.samples, end - start))
        for begin, end in record.bounds
        for start in range(begin + warm_up, end, interval or record.samples)
    ]
    if not pairs:
        longest = max(record.segments)
        raise RecordError(
            f"the longest recording has {longest} samples and the warm-up takes {warm_up}: "
            "take a longer recording, smaller lags or a shorter warm-up"
        )
    start, length = np.array(pairs, np.int64).T
    return np.ascontiguousarray(start), np.ascontiguousarray(length)


def _check_warm_up(y: NDArray[np.float64], start: NDArray[np.int64], warm_up: int) -> None:
    missing = np.concatenate([[0], np.cumsum(np.isnan(y))])
    bad = np.flatnonzero(missing[start] > missing[start - warm_up])
    if bad.size:
        first = int(start[bad[0]]) - warm_up
        sample = first + int(np.flatnonzero(np.isnan(y[first : first + warm_up]))[0])
        raise RecordError(
            f"the output is missing at sample {sample}, where a simulation starts from it: "
            "use a free run, which needs it in the first samples alone, or fill the gap"
        )
