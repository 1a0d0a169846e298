"""Layout of a record's shooting intervals in memory, in the kernel's order [block][time][lane]."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError
from islands.kernels.simd import padded_size
from islands.kernels.simulate import WIDTHS, Layout
from islands.records.coupled import AnyRecord
from islands.records.dataset import Dataset

#: Fixed cost of an instruction, in units of its cost per lane.
_OVERHEAD_LANES = 24


# The layouts of recent calls are kept: a search simulates many models on few records, which never change.
@lru_cache(maxsize=16)
def layout(
    record: Dataset, warm_up: int, interval: int | None = None, widths: tuple[int, ...] | None = None
) -> Layout:
    """Lay out a record for a simulation.

    Parameters
    ----------
    record : Dataset
    warm_up : int
        Number of measured samples before the first prediction of every segment and interval.
    interval : int or None
        Length of a shooting interval in samples: 1 is one-step-ahead, None is the free run over each whole
        segment. The last interval of a segment may be shorter.
    widths : tuple of int, optional
        Possible numbers of lanes per row, among which the number of intervals decides; `WIDTHS` by default.

    Raises
    ------
    RecordError
        No segment is longer than the warm-up, or the output is missing in the warm-up of an interval.
    SettingsError
        The interval is less than 1.
    """
    if interval is not None and interval < 1:
        raise SettingsError(f"a shooting interval has at least 1 sample, got {interval}")
    start, length = find_intervals(record, warm_up, interval)
    check_warm_up(record.y, start, warm_up)
    signals = np.ascontiguousarray(np.vstack([record.y, record.u.T]))
    known = record.y[~np.isnan(record.y)]
    largest = float(np.abs(known).max()) if known.size else 0.0
    width = min(widths or WIDTHS, key=lambda lanes: -(-len(start) // lanes) * (lanes + _OVERHEAD_LANES))
    cuts = np.arange(0, len(start), width)
    if interval == 1:
        # One-step-ahead prediction needs no gathering: adjacent lanes are adjacent samples of one segment.
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
        # A short lane is filled with the following samples of the record; unused lanes repeat the first.
        samples = start[cut : cut + count] - warm_up + np.arange(steps)[:, None]
        block = gathered[:, at : at + steps * width].reshape(len(signals), steps, width)
        block[:, :, :count] = signals[:, np.minimum(samples, record.samples - 1)]
        block[:, :, count:] = block[:, :, :1]
    return Layout(gathered, offset, lanes, width, start, length, width, warm_up, largest)


def find_intervals(
    record: AnyRecord, warm_up: int, interval: int | None
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first predicted sample and the length of every interval, in time order.

    Raises
    ------
    RecordError
        No segment is longer than the warm-up.
    """
    step = interval or record.samples
    starts = [np.arange(begin + warm_up, end, step) for begin, end in record.bounds]
    if not any(own.size for own in starts):
        longest = max(record.segments)
        raise RecordError(
            f"the longest recording has {longest} samples and the warm-up takes {warm_up}: "
            "take a longer recording, smaller lags or a shorter warm-up"
        )
    ends = [np.full(own.size, end) for own, (_, end) in zip(starts, record.bounds, strict=True)]
    start = np.concatenate(starts)
    return start, np.minimum(step, np.concatenate(ends) - start)


def check_warm_up(y: NDArray[np.float64], start: NDArray[np.int64], warm_up: int) -> None:
    """Check that no output is missing in the warm-up before the first samples of the intervals.

    Raises
    ------
    RecordError
        The message names the sample.
    """
    missing = np.concatenate([[0], np.cumsum(np.isnan(y))])
    bad = np.flatnonzero(missing[start] > missing[start - warm_up])
    if bad.size:
        first = int(start[bad[0]]) - warm_up
        sample = first + int(np.flatnonzero(np.isnan(y[first : first + warm_up]))[0])
        raise RecordError(
            f"the output is missing at sample {sample}, where a simulation starts from it: "
            "use a free run, which only needs the first samples, or a shorter warm-up, or fill the gap"
        )
