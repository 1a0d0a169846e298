"""Repeated rows and missing values of a recording: left out, averaged or interpolated."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from islands.records.reading.sampling.recording import Recording, count_text


def drop_repeated(recording: Recording, average: bool, steps: list[str]) -> Recording:
    """Leave out rows that repeat the row before, and average rows of equal time before resampling."""
    same = np.diff(recording.stamps) == 0
    equal = same & _rows_equal(recording.values[1:], recording.values[:-1])
    if equal.any():
        where = recording.rows.row(int(np.argmax(equal)) + 1)
        steps.append(f"left out: {count_text(int(equal.sum()), 'repeated row')}, the first is {where}")
        recording = recording[np.concatenate(([True], ~equal))]
        same = np.diff(recording.stamps) == 0
    if not (average and same.any()):
        return recording
    first = np.concatenate(([True], ~same))
    starts = np.flatnonzero(first)
    counts = np.diff(np.append(starts, len(first)))
    means = np.add.reduceat(recording.values, starts) / counts[:, None]
    where = recording.rows.row(int(np.argmax(same)) + 1)
    steps.append(
        f"averaged with the row before: {count_text(int(same.sum()), 'row')} of equal time, the first "
        f"is {where}"
    )
    return replace(recording[first], values=means)


def _rows_equal(one: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.bool_]:
    equal: NDArray[np.bool_] = ((one == other) | (np.isnan(one) & np.isnan(other))).all(axis=1)
    return equal


def repair_missing(
    recording: Recording, required: Collection[int], gaps: str, steps: list[str]
) -> tuple[Recording, NDArray[np.bool_]]:
    """Leave out or interpolate missing values; also return where rows were left out between two others."""
    untimed = np.isnan(recording.stamps)
    if untimed.any():
        steps.append(
            f"left out: {count_text(int(untimed.sum()), 'row')} without a time, the first is "
            f"{_first(recording, untimed)}"
        )
        recording = recording[~untimed]
    columns = sorted(required)
    absent = np.isnan(recording.values[:, columns])
    missing = np.asarray(absent.any(axis=1))
    if not missing.any():
        return recording, np.zeros(max(len(recording.stamps) - 1, 0), np.bool_)
    if gaps == "split":
        steps.append(
            f"left out: {count_text(int(missing.sum()), 'row')} with missing values, the first is "
            f"{_first(recording, missing)}"
        )
        kept = np.flatnonzero(~missing)
        return recording[~missing], np.diff(kept) > 1
    if absent.all(axis=0).any():
        return recording, np.zeros(len(recording.stamps) - 1, np.bool_)  # refused with the column's name
    ends = [(int(np.argmin(column)), len(column) - int(np.argmin(column[::-1]))) for column in absent.T]
    inner = slice(max(begin for begin, _ in ends), min(end for _, end in ends))
    outside = len(missing) - max(0, inner.stop - inner.start)
    if outside:
        rows = count_text(outside, "row")
        steps.append(f"left out: {rows} before the first or after the last value of a column")
    steps.append(
        f"interpolated: {count_text(int(absent[inner].sum()), 'missing value')}, the first in "
        f"{_first(recording, missing)}"
    )
    values = recording.values.copy()
    for column, gone in zip(columns, absent.T, strict=True):
        values[gone, column] = np.interp(
            recording.stamps[gone], recording.stamps[~gone], values[~gone, column]
        )
    recording = replace(recording, values=values)[inner]
    return recording, np.zeros(max(len(recording.stamps) - 1, 0), np.bool_)


def _first(recording: Recording, chosen: NDArray[np.bool_]) -> str:
    return recording.rows.row(int(np.argmax(chosen)))
