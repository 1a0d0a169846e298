"""Averages of consecutive samples, which reduce the sampling rate and the noise of a record."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, SettingsError
from islands.records.channel_names import parse_channel_name
from islands.records.dataset import Dataset

#: Value of the setting ``average`` that compares rates on the validation data.
AUTO = "auto"


def average_samples(record: Dataset, count: int) -> Dataset:
    """Return a record of the means of ``count`` consecutive samples.

    No mean contains samples of two segments: the last samples of a segment that do not fill a mean are left
    out, and so are segments that are shorter than a mean. The time of a mean is the middle of its samples. A
    mean over a missing output is missing.

    Parameters
    ----------
    record : Dataset
    count : int
        Number of samples of a mean. The sampling time is multiplied by it.

    Returns
    -------
    Dataset
        The record itself for a count of 1.

    Raises
    ------
    SettingsError
        The count is less than 1.
    RecordError
        Every segment has fewer than ``count`` samples, or an input is read one sample early: the column
        refers to the sampling time of the record.
    """
    if count < 1:
        raise SettingsError(f"a mean has at least 1 sample, got {count}")
    if count == 1:
        return record
    if early := [name for name in record.input_names if parse_channel_name(name).at_once]:
        raise RecordError(
            f"{early[0]} is read one sample early, so it has no means: read the input without "
            "+1 and take feedthrough yes, or set average to 1"
        )
    if max(record.segments) < count:
        raise RecordError(
            f"a recording of {max(record.segments)} samples has no mean of {count}: give longer "
            "recordings, or average fewer samples"
        )
    lengths = [length // count for length in record.segments]
    return replace(
        record,
        u=np.column_stack([_average(signal, record, count) for signal in record.u.T]),
        **record.change_outputs(lambda y: _average(y, record, count)),
        dt=record.dt * count,
        segments=tuple(length for length in lengths if length),
        recordings=tuple(name for name, length in zip(record.recordings, lengths, strict=True) if length),
        start=record.start + 0.5 * (count - 1) * record.dt,
        sha256="",
        held_out=0,
    )


def count_means(samples: int, count: int) -> int:
    """Return the number of means of ``count`` samples in an interval of ``samples``, at least one."""
    return max(1, round(samples / count))


def check_average(average: int | str) -> None:
    """Check the setting ``average``.

    Raises
    ------
    SettingsError
        It is neither ``auto`` nor a positive integer.
    """
    if average != AUTO and (not str(average).isdecimal() or int(average) < 1):
        raise SettingsError(f"average is auto or a number of samples from 1 on, got {average!r}")


def _average(signal: NDArray[np.float64], record: Dataset, count: int) -> NDArray[np.float64]:
    blocks = np.concatenate(
        [signal[first : last - (last - first) % count].reshape(-1, count) for first, last in record.bounds]
    )
    # Deviations from the first sample keep the digits of a signal with a large offset. The loop fixes the
    # order of the additions.
    sums = np.zeros(len(blocks))
    for place in range(1, count):
        sums += blocks[:, place] - blocks[:, 0]
    means: NDArray[np.float64] = blocks[:, 0] + sums / count
    return means
