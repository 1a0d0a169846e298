"""Cut a record into shooting intervals and lay them out for the kernel as [block][time][lane]."""

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.kernels.simd import padded_size
from islands.kernels.simulate import WIDTHS, Layout

#: What an instruction costs besides the work on its row, in lanes.
_OVERHEAD = 24


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
    known = record.y[~np.isnan(record.y)]
    largest = float(np.abs(known).max()) if known.size else 0.0
    width = min(WIDTHS, key=lambda lanes: -(-len(start) // lanes) * (lanes + _OVERHEAD))
    cuts = np.arange(0, len(start), width)
    if interval == 1:
        # One step ahead needs no gathering: neighbouring lanes are neighbouring samples of one segment.
        cuts = np.union1d(cuts, np.flatnonzero(np.diff(start) != 1) + 1)
        lanes = np.diff(np.append(cuts, len(start)))
        padded = np.pad(signals, ((0, 0), (0, width)), mode="edge")
        return Layout(padded, start[cuts] - warm_up, lanes, 1, start, length, width, warm_up, largest)
    order = np.argsort(-length, kind="stable")
    start, length = start[order], length[order]
    lanes = np.diff(np.append(cuts, len(start)))
    rows = warm_up + length[cuts]
    offset = width * (np.cumsum(rows) - rows)
    gathered = padded_size(len(signals) * int(rows.sum()) * width).reshape(len(signals), -1)
    for cut, count, at, steps in zip(cuts, lanes, offset, rows, strict=True):
        # A short lane goes on at the record's end; lanes that nobody has asked for repeat the first.
        samples = start[cut : cut + count] - warm_up + np.arange(steps)[:, None]
        block = gathered[:, at : at + steps * width].reshape(len(signals), steps, width)
        block[:, :, :count] = signals[:, np.minimum(samples, record.samples - 1)]
        block[:, :, count:] = block[:, :, :1]
    return Layout(gathered, offset, lanes, width, start, length, width, warm_up, largest)


def _intervals(
    record: Dataset, warm_up: int, interval: int | None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return first sample and length of every interval, in the order of time."""
    step = interval or record.samples
    starts = [np.arange(begin + warm_up, end, step) for begin, end in record.bounds]
    if not any(begun.size for begun in starts):
        longest = max(record.segments)
        raise RecordError(
            f"the longest recording has {longest} samples and the warm-up takes {warm_up}: "
            "take a longer recording, smaller lags or a shorter warm-up"
        )
    ends = [np.full(begun.size, end) for begun, (_, end) in zip(starts, record.bounds, strict=True)]
    start = np.concatenate(starts)
    return start, np.minimum(step, np.concatenate(ends) - start)


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
