"""Repair of irregular sampling: gaps and missing values become segments or are interpolated, or resampled."""

from collections.abc import Collection, Sequence
from itertools import pairwise
from math import ceil

import numpy as np
from numpy.typing import NDArray

from islands.errors import RecordError, join_text, name_option
from islands.records.reading.sampling.missing_values import drop_repeated, repair_missing
from islands.records.reading.sampling.recording import Recording, UniformRecording, count_text
from islands.records.reading.sampling.uniform_grid import (
    AGREEMENT,
    GAP,
    allowed_deviation,
    describe_gaps,
    uniform_step,
)
from islands.records.reading.size_limits import MOST_SAMPLES

#: Taps of the low-pass filter on each side, in samples of the new grid.
_HALF_TAPS = 10

#: Descriptions of both ways, for the result.
LINEAR = "linear interpolation"
FILTERED = "a linear-phase low-pass filter (Hamming window) and linear interpolation"


def resample(
    stamps: NDArray[np.float64], values: NDArray[np.float64], dt: float, usual: float
) -> tuple[NDArray[np.float64], str]:
    """Resample the columns of one recording.

    A coarser grid would fold frequencies above half of its rate into the result. They are removed on a
    finer uniform grid by a finite impulse response filter, which does not delay the signals.

    Parameters
    ----------
    stamps : ndarray, shape (samples,)
        Increasing times.
    values : ndarray, shape (samples, columns)
        Finite values, or NaN where the result is NaN too.
    dt, usual : float
        Step of the new grid, and the usual step of the stamps, in the same unit.

    Returns
    -------
    values : ndarray, shape (new samples, columns)
        The first new sample is at the first stamp.
    method : str
        `LINEAR` or `FILTERED`.
    """
    count = int((stamps[-1] - stamps[0]) / dt * (1.0 + 1e-12)) + 1
    ratio = ceil(dt / usual - 1e-6)
    if ratio <= 1:
        grid = stamps[0] + dt * np.arange(count)
        return _interpolate(grid, stamps, values), LINEAR
    # The values at the ends continue beyond the recording.
    reach = _HALF_TAPS * ratio
    fine = stamps[0] + dt / ratio * np.arange(-reach, (count - 1) * ratio + reach + 1)
    padded = _interpolate(fine, stamps, values)
    taps = _low_pass_taps(ratio)
    filtered = np.zeros((count, values.shape[1]))
    # Summed tap by tap: the order of the sum is the same on every machine.
    for place, tap in enumerate(taps.tolist()):
        filtered += tap * padded[place : place + (count - 1) * ratio + 1 : ratio]
    return filtered, FILTERED


def _interpolate(
    grid: NDArray[np.float64], stamps: NDArray[np.float64], values: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.column_stack([np.interp(grid, stamps, column) for column in values.T])


def _low_pass_taps(ratio: int) -> NDArray[np.float64]:
    """Return a windowed sinc with a cut-off at 0.8 of half the new rate; the taps sum to one."""
    offsets = np.arange(-_HALF_TAPS * ratio, _HALF_TAPS * ratio + 1, dtype=np.float64)
    taps = np.sinc(0.8 * offsets / ratio) * np.hamming(len(offsets))
    normalised: NDArray[np.float64] = taps / taps.sum()
    return normalised


#: With resampling, a gap is longer than this many of the longest one per cent of the steps, and than two new
#: steps: irregular sampling has long steps too.
_LONG, _NEW_STEPS = 4.0, 2.0


def make_uniform(
    recording: Recording, required: Collection[int], gaps: str | None, dt: float | None
) -> UniformRecording:
    """Return a recording on a uniform grid.

    Parameters
    ----------
    recording : Recording
    required : collection of int
        Columns in which a missing value is repaired; in the others it remains NaN.
    gaps : str or None
        ``split`` leaves rows with missing values out and makes a segment of every part between gaps;
        ``interpolate`` fills gaps and missing values linearly; None refuses both.
    dt : float or None
        Sampling time in seconds to resample to; by default that of the recording.

    Raises
    ------
    RecordError
        The recording has gaps or stamps that the chosen options do not repair.
    """
    steps: list[str] = []
    recording = drop_repeated(recording, dt is not None, steps)
    breaks = np.zeros(max(len(recording.stamps) - 1, 0), np.bool_)
    if gaps is not None:
        recording, breaks = repair_missing(recording, required, gaps, steps)
    steps_between = np.diff(recording.stamps)
    back = steps_between < 0
    if (steps_between == 0).any() or (back.any() and gaps != "split"):
        uniform_step(recording.stamps, recording.time, recording.rows)  # raises
    breaks |= back
    usual = _usual_step(recording)
    found = _find_gaps(recording.stamps, usual, dt and dt / recording.seconds)
    if found.any() and gaps is None:
        uniform_step(recording.stamps, recording.time, recording.rows, recording.seconds)
        raise _gap_error(recording, found)
    if gaps == "split" and (breaks | found).any():
        return _split(recording, breaks | found, usual, dt, steps)
    parts = [recording]
    if dt is None:
        values, step = _fill(recording, usual, found, steps)
        return UniformRecording(values, step * recording.seconds, _start(parts), (len(values),), tuple(steps))
    if found.any():
        steps.append(f"interpolated: {describe_gaps(recording.stamps, recording.rows, found)}")
    return _resample_parts(parts, usual, dt, steps)


def join_recordings(parts: Sequence[UniformRecording], file: str) -> UniformRecording:
    """Return recordings of one file as one, each a segment or several.

    Raises
    ------
    RecordError
        Their sampling times differ.
    """
    if len(parts) == 1:
        return parts[0]
    first = parts[0]
    for number, part in enumerate(parts, 1):
        if abs(part.dt - first.dt) > AGREEMENT * first.dt:
            raise RecordError(
                join_text(
                    f"{file}: the sampling time of recording 1 is {first.dt:.6g} s, that of recording "
                    f"{number} {part.dt:.6g} s: give ",
                    name_option("resample", max(part.dt, first.dt)),
                )
            )
    segments = (length for part in parts for length in part.segments or (len(part.values),))
    steps = (f"recording {number}: {step}" for number, part in enumerate(parts, 1) for step in part.steps)
    return UniformRecording(
        np.concatenate([part.values for part in parts]), first.dt, first.start, tuple(segments), tuple(steps)
    )


def _start(parts: list[Recording]) -> float:
    return float(parts[0].stamps[0]) * parts[0].seconds


def _usual_step(recording: Recording) -> float:
    steps = np.diff(recording.stamps)
    steps = steps[steps > 0]
    if not len(steps):
        raise RecordError(
            join_text(
                f"{recording.rows.file}: column {recording.time} never increases: name another time column "
                "by ",
                name_option("time"),
            )
        )
    return float(np.median(steps))


def _find_gaps(stamps: NDArray[np.float64], usual: float, new: float | None) -> NDArray[np.bool_]:
    steps = np.diff(stamps)
    least = GAP * usual if new is None else max(_LONG * float(np.quantile(steps, 0.99)), _NEW_STEPS * new)
    gaps: NDArray[np.bool_] = steps > least
    return gaps


def _gap_error(recording: Recording, found: NDArray[np.bool_]) -> RecordError:
    described = describe_gaps(recording.stamps, recording.rows, found)
    return RecordError(
        join_text(
            f"{recording.rows.file}, column {recording.time}: {described}: give ",
            name_option("gaps", "split"),
            " for segments or ",
            name_option("gaps", "interpolate"),
            " to fill them",
        )
    )


def _split(
    recording: Recording, breaks: NDArray[np.bool_], usual: float, dt: float | None, steps: list[str]
) -> UniformRecording:
    """Make a segment of every part between breaks. A part of one sample has no step and is left out."""
    ends = [0, *(np.flatnonzero(breaks) + 1).tolist(), len(recording.stamps)]
    parts = [recording[slice(begin, end)] for begin, end in pairwise(ends)]
    lone = [part for part in parts if len(part.stamps) < 2]
    parts = [part for part in parts if len(part.stamps) >= 2]
    where = recording.rows.row(int(np.argmax(breaks)) + 1)
    gaps = count_text(int(breaks.sum()), "gap")
    steps.append(f"split at {gaps} into {count_text(len(parts), 'segment')}, the first gap is before {where}")
    if lone:
        rows = count_text(len(lone), "single row")
        steps.append(f"left out: {rows} between gaps, the first is {lone[0].rows.row(0)}")
    if not parts:
        raise _gap_error(recording, breaks)
    if dt is not None:
        return _resample_parts(parts, usual, dt, steps)
    step = _common_step(parts)
    values = np.concatenate([part.values for part in parts])
    lengths = tuple(len(part.stamps) for part in parts)
    return UniformRecording(values, step * recording.seconds, _start(parts), lengths, tuple(steps))


def _common_step(parts: list[Recording]) -> float:
    """Return the mean step of all parts, after a check that each part is uniform with this step."""
    step = sum(float(part.stamps[-1] - part.stamps[0]) for part in parts) / sum(
        len(part.stamps) - 1 for part in parts
    )
    for part in parts:
        if len(part.stamps) > 2:
            uniform_step(part.stamps, part.time, part.rows, part.seconds)
        places = np.arange(len(part.stamps)) - (len(part.stamps) - 1) / 2
        deviation = np.abs(part.stamps - part.stamps.mean() - step * places)
        # A part of two samples has a step below the length of a gap.
        if len(places) > 2 and (deviation > allowed_deviation(part.stamps, step)).any():
            raise RecordError(
                join_text(
                    f"{part.rows.file}, {part.rows.row(0)} to {part.rows.row(-1)}: the step of this part "
                    f"differs from the usual step {step:.6g}: give ",
                    name_option("resample", step * part.seconds),
                )
            )
    return step


def _fill(
    recording: Recording, usual: float, found: NDArray[np.bool_], steps: list[str]
) -> tuple[NDArray[np.float64], float]:
    """Interpolate the samples that are missing on the grid; return all values and the step."""
    stamps = recording.stamps
    if not found.any():
        return recording.values, uniform_step(stamps, recording.time, recording.rows, recording.seconds)
    counts = np.maximum(1, np.rint(np.diff(stamps) / usual)).astype(np.int64)
    places = np.concatenate(([0], np.cumsum(counts)))
    _check_count(int(places[-1]) + 1, recording)
    step = float(stamps[-1] - stamps[0]) / int(places[-1])
    # A line through all stamps against their places on the grid.
    centred = places - places.mean()
    slope = float(centred @ (stamps - stamps.mean()) / (centred @ centred))
    deviation = np.abs(stamps - stamps.mean() - slope * centred)
    if (deviation > allowed_deviation(stamps, step)).any():
        sample = max(1, int(np.argmax(deviation)))
        raise RecordError(
            join_text(
                f"{recording.rows.place(sample, recording.time)} is off the uniform grid of the other rows, "
                f"whose step is {slope:.6g}: give ",
                name_option("resample", slope * recording.seconds),
                " as well",
            )
        )
    samples = count_text(int(places[-1]) + 1 - len(stamps), "sample")
    steps.append(f"interpolated: {samples} in {describe_gaps(stamps, recording.rows, found)}")
    grid = np.arange(int(places[-1]) + 1)
    return np.column_stack([np.interp(grid, places, column) for column in recording.values.T]), step


def _resample_parts(parts: list[Recording], usual: float, dt: float, steps: list[str]) -> UniformRecording:
    seconds = parts[0].seconds
    _check_count(int(sum(float(part.stamps[-1] - part.stamps[0]) for part in parts) * seconds / dt), parts[0])
    resampled = [resample(part.stamps, part.values, dt / seconds, usual) for part in parts]
    is_same = abs(usual * seconds - dt) <= AGREEMENT * dt
    change = f"to uniform steps of {dt:.6g} s" if is_same else f"from {usual * seconds:.6g} s to {dt:.6g} s"
    steps.append(f"resampled {change} by {resampled[0][1]}")
    lengths = tuple(len(values) for values, _ in resampled)
    return UniformRecording(
        np.concatenate([values for values, _ in resampled]), dt, _start(parts), lengths, tuple(steps)
    )


def _check_count(samples: int, recording: Recording) -> None:
    if samples > MOST_SAMPLES:
        raise RecordError(
            join_text(
                f"{recording.rows.file}: a uniform grid would have {samples} samples, and {MOST_SAMPLES} is "
                "the most: take a longer sampling time, or ",
                name_option("gaps", "split"),
            )
        )
