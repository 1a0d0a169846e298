"""Columns of different clocks brought to that of the slowest column, without a shift in time.

An input that is sampled at other times is averaged from each sample of the record to the next: a system with
memory responds to the mean of its input over a sample, as if it were held, and u(k-1) is the mean that ends
where y(k) is sampled. Between its samples, an input that is smooth is interpolated, and another one is held.
The output of a simulation is read at the samples of the record. An output has only values that were measured:
one that is interpolated between two samples contains the response to inputs of a later time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from islands.records.reading.options import MEAN, SAMPLE
from islands.records.reading.sampling.column_clocks import SAME_STEP, ColumnClock
from islands.records.reading.sampling.recording import Recording, count_text
from islands.records.reading.sampling.uniform_grid import AGREEMENT, GAP
from islands.rounding import ROUNDING

_HOW = {MEAN: "the mean from each to the next", SAMPLE: "the value at each"}

#: Beginning of the statement about the clocks.
_DIFFERENT = "columns have samples at different times"

#: Deviation of a gap from a whole number of steps, in steps, up to which samples are missing in it.
#: Also the part of equal samples by which two clocks may differ and be the same.
_WHOLE = 0.25


#: Mean square of the deviations from the neighbours, relative to that of the steps, of a smooth signal, at
#: most; samples that determine it, at least.
_SMOOTH, _LEAST_SMOOTH = 0.1, 12

#: Part of the squared error of a prediction below which values predict better than means, and samples for
#: each term of the prediction, at least.
_MUCH_LESS, _LEAST_PREDICTED = 0.5, 8


@dataclass(frozen=True, slots=True)
class ColumnUse:
    """Columns of a recording: their names, which are outputs, and how faster inputs are read.

    Attributes
    ----------
    names : tuple of str
    outputs : tuple of int
        Places of the outputs.
    rates : str
        `MEAN` or `SAMPLE`.
    extend : bool
        Whether samples are needed as far as the inputs reach, although the output has ended.
    signals : tuple of int
        Places of inputs that are read at the samples of the record whatever their rate, such as the output of
        a simulation.
    """

    names: tuple[str, ...]
    outputs: tuple[int, ...]
    rates: str = MEAN
    extend: bool = False
    signals: tuple[int, ...] = ()


def align_columns(
    recording: Recording, clocks: Sequence[ColumnClock], use: ColumnUse, steps: list[str]
) -> Recording:
    """Return the samples of all columns at the times of the slowest one.

    Parameters
    ----------
    recording : Recording
        Rows of the file.
    clocks : sequence of ColumnClock
        Clocks of the columns.
    use : ColumnUse
    steps : list of str
        What was done is appended.
    """
    slowest, clock = _choose_clock(clocks, use.outputs)
    step, stamps = clock.step, clock.stamps
    if slowest in use.outputs:
        stamps = _fill_gaps(stamps, step)
        if use.extend:
            others = [each.stamps for place, each in enumerate(clocks) if place not in use.outputs]
            stamps = _extend(stamps, step, min(each[0] for each in others), max(each[-1] for each in others))
    values = np.column_stack(
        [
            _read_column(column[own.rows], own, stamps, step, use, place)
            for place, (column, own) in enumerate(zip(recording.values.T, clocks, strict=True))
        ]
    )
    inputs = [place for place in range(len(clocks)) if place not in use.outputs]
    known = np.asarray(np.isfinite(values[:, inputs]).all(axis=1))
    if not use.extend:
        known &= (stamps <= clock.stamps[-1]) & (stamps >= clock.stamps[0])
    kept = slice(int(np.argmax(known)), len(known) - int(np.argmax(known[::-1]))) if known.any() else slice(0)
    steps.append(_describe(clocks, use, slowest, clock, recording))
    if left := len(known) - len(stamps[kept]):
        steps.append(f"left out: {count_text(left, 'sample')} before the first or after the last of a column")
    rows = _find_rows(recording.stamps, stamps[kept])
    return replace(recording[rows], stamps=stamps[kept], values=values[kept])


def choose_rates(recording: Recording, clocks: Sequence[ColumnClock], use: ColumnUse) -> str:
    """Return whether the means of faster inputs predict the outputs, or only their values at each sample.

    The output of a system that is much faster than its record follows the value of an input at once: means
    would blur it. Values are taken if they leave `_MUCH_LESS` of the error of a linear prediction.
    """
    errors = []
    for rates in (MEAN, SAMPLE):
        aligned = align_columns(recording, clocks, replace(use, rates=rates), []).values
        errors.append(_measure_prediction(aligned, use.outputs))
    return SAMPLE if errors[1] < _MUCH_LESS * errors[0] else MEAN


def _measure_prediction(values: NDArray[np.float64], outputs: Sequence[int]) -> float:
    """Return the mean squared error of outputs by their past and the inputs, relative to their variances.

    It is zero if there are too few samples.
    """
    inputs = [place for place in range(values.shape[1]) if place not in outputs]
    now, last, before = values[2:], values[1:-1], values[:-2]
    total = 0.0
    for place in outputs:
        past = (last[:, place], before[:, place])
        terms = np.column_stack(
            (*past, now[:, inputs], last[:, inputs], before[:, inputs], np.ones(len(now)))
        )
        known = np.isfinite(terms).all(axis=1) & np.isfinite(now[:, place])
        terms, target = terms[known], now[known, place]
        if len(target) < _LEAST_PREDICTED * terms.shape[1] or np.ptp(target) == 0.0:
            return 0.0
        scale = np.maximum(np.abs(terms).max(axis=0), np.finfo(np.float64).tiny)
        weights = np.linalg.lstsq(terms / scale, target)[0]
        total += float(np.mean((target - terms / scale @ weights) ** 2) / np.var(target))
    return total


def common_step(clocks: Sequence[ColumnClock]) -> float | None:
    """Return the step of the slowest column, None if its samples are not uniform."""
    slowest = clocks[_find_slowest(clocks, ())]
    stamps = _fill_gaps(slowest.stamps, slowest.step)
    deviation = np.abs(np.diff(stamps) - slowest.step)
    return slowest.step if (deviation <= _WHOLE * slowest.step).all() else None


def fill_between(
    recording: Recording, clocks: Sequence[ColumnClock], use: ColumnUse, steps: list[str]
) -> Recording:
    """Interpolate every column between its samples, also those that only hold the sample before.

    Rows in gaps of a column, and before its first and after its last sample, have no value; the latter are
    left out. An output that may end before the inputs does not limit the rows.
    """
    ordered = recording[np.argsort(recording.stamps, kind="stable")]
    values = ordered.values.copy()
    for place, own in enumerate(clocks):
        if own.kind != "rows":
            values[:, place] = _interpolate(own, recording.values[own.rows, place], ordered.stamps)
            text = _describe_step(own, recording.seconds)
            steps.append(f"interpolated: {use.names[place]} between its samples, {text}")
    limiting = [own for place, own in enumerate(clocks) if not (use.extend and place in use.outputs)]
    first = max(own.stamps[0] for own in limiting)
    last = min(own.stamps[-1] for own in limiting)
    inside = (ordered.stamps >= first) & (ordered.stamps <= last)
    return replace(ordered, values=values)[inside]


def _find_slowest(clocks: Sequence[ColumnClock], outputs: Sequence[int]) -> int:
    """Return the column of the longest step; an output, if several steps are equal."""
    longest = max(each.step for each in clocks)
    slow = [place for place, each in enumerate(clocks) if each.step >= (1 - SAME_STEP) * longest]
    return next((place for place in slow if place in outputs), slow[0])


def _choose_clock(clocks: Sequence[ColumnClock], outputs: Sequence[int]) -> tuple[int, ColumnClock]:
    """Return the column whose samples are those of the record, and their clock.

    If an input is the slowest, and the output has no samples at its times, every few samples of the output
    are taken.
    """
    slowest = _find_slowest(clocks, outputs)
    clock = clocks[slowest]
    for place in outputs:
        own = clocks[place]
        if slowest in outputs or _match(own.stamps, clock.stamps, own.step)[1].mean() > 1 - _WHOLE:
            continue
        every = max(1, round(clock.step / own.step))
        thinned = ColumnClock(own.rows[::every], own.stamps[::every], own.step * every, own.kind)
        return place, thinned
    return slowest, clock


def _match(
    own: NDArray[np.float64], stamps: NDArray[np.float64], step: float
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return the sample at each time, and whether there is one."""
    near = np.clip(np.searchsorted(own, stamps - AGREEMENT * step), 0, len(own) - 1)
    return near, np.abs(own[near] - stamps) <= AGREEMENT * step


def _fill_gaps(stamps: NDArray[np.float64], step: float) -> NDArray[np.float64]:
    """Insert the times of missing samples into gaps of a whole number of steps."""
    steps = np.diff(stamps)
    counts = np.rint(steps / step)
    counts[(np.abs(steps / step - counts) > _WHOLE) | (counts < 1)] = 1
    places = np.concatenate(([0.0], np.cumsum(counts)))
    filled: NDArray[np.float64] = np.interp(np.arange(places[-1] + 1), places, stamps)
    return filled


def _extend(stamps: NDArray[np.float64], step: float, first: float, last: float) -> NDArray[np.float64]:
    """Continue times to the first and last of other columns."""
    before, after = (max(0, int(reach / step + 1e-6)) for reach in (stamps[0] - first, last - stamps[-1]))
    parts = (stamps[0] - step * np.arange(before, 0, -1), stamps, stamps[-1] + step * np.arange(1, after + 1))
    return np.concatenate(parts)


def _read_column(
    samples: NDArray[np.float64],
    own: ColumnClock,
    stamps: NDArray[np.float64],
    step: float,
    use: ColumnUse,
    place: int,
) -> NDArray[np.float64]:
    near, same = _match(own.stamps, stamps, min(step, own.step))
    exact = np.where(same, samples[near], np.nan)
    if place in use.outputs:
        return exact
    # Rows of several clocks may have the usual step of the record, and samples between those of the record.
    has_same = same.mean() > 1 - _WHOLE and len(own.stamps) < (1 + _WHOLE) * len(stamps)
    if use.rates == SAMPLE or place in use.signals or has_same:
        return np.where(same, exact, _interpolate(own, samples, stamps))
    return _average(own, samples, stamps, step)


def _interpolate(
    own: ColumnClock, samples: NDArray[np.float64], stamps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Interpolate linearly between samples; times outside of them and in their gaps have no value."""
    found = np.interp(stamps, own.stamps, samples, left=np.nan, right=np.nan)
    after = np.clip(np.searchsorted(own.stamps, stamps), 1, len(own.stamps) - 1)
    between = (own.stamps[after] != stamps) & (own.stamps[after - 1] != stamps)
    found[between & (np.diff(own.stamps)[after - 1] > GAP * own.step)] = np.nan
    return found


def _average(
    own: ColumnClock, samples: NDArray[np.float64], stamps: NDArray[np.float64], step: float
) -> NDArray[np.float64]:
    """Return the means of a signal from each time to the next; none over a gap or before the start.

    Between its samples a smooth signal is interpolated, and another one is held: holding delays a signal by
    half of its step.
    """
    ends = np.minimum(np.concatenate((stamps[1:], [np.inf])), stamps + (1 + _WHOLE) * step)
    ends[-1] = stamps[-1] + step
    edges = np.concatenate((own.stamps, [own.stamps[-1] + own.step]))
    lengths = np.diff(edges)
    # What follows a sample in a gap is unknown. Deviations from the first sample keep the digits of a signal
    # with a large offset.
    unknown = lengths > GAP * own.step
    deviations = samples - samples[0]
    following = np.concatenate((deviations[1:], deviations[-1:])) if _is_smooth(samples) else deviations
    areas = np.concatenate(([0.0], np.cumsum(0.5 * (deviations + following) * lengths)))
    missing = np.concatenate(([0.0], np.cumsum(np.where(unknown, lengths, 0.0))))
    begins, ends = (np.clip(times, edges[0], edges[-1]) for times in (stamps, ends))
    known = (stamps >= edges[0] - AGREEMENT * step) & (ends > begins)
    width = np.where(known, ends - begins, 1.0)

    def integrate(times: NDArray[np.float64]) -> NDArray[np.float64]:
        place = np.clip(np.searchsorted(edges, times, "right") - 1, 0, len(samples) - 1)
        passed = times - edges[place]
        slopes = (following - deviations) / lengths
        found: NDArray[np.float64] = areas[place] + passed * (
            deviations[place] + 0.5 * slopes[place] * passed
        )
        return found

    means = (integrate(ends) - integrate(begins)) / width + samples[0]
    # A command at rest has its value exactly, and so the same levels as before.
    held = samples[np.clip(np.searchsorted(own.stamps, begins, "right") - 1, 0, len(samples) - 1)]
    means = np.where(np.abs(means - held) <= ROUNDING * np.ptp(samples), held, means)
    known &= np.interp(ends, edges, missing) - np.interp(begins, edges, missing) <= AGREEMENT * own.step
    return np.where(known, means, np.nan)


def _is_smooth(samples: NDArray[np.float64]) -> bool:
    """Return whether samples are close to the mean of their neighbours, compared with the steps between them.

    The ratio of the mean squares is 0.5 for a command that rests between its steps, and 0.75 for white noise.
    """
    if len(samples) < _LEAST_SMOOTH:
        return False
    scale = float(np.ptp(samples)) or 1.0
    steps = np.diff(samples / scale)
    return float(np.mean((0.5 * np.diff(steps)) ** 2)) < _SMOOTH * float(np.mean(steps**2))


def _find_rows(stamps: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the rows nearest to times, for messages."""
    order = np.argsort(stamps, kind="stable")
    ordered = stamps[order]
    after = np.clip(np.searchsorted(ordered, times), 1, len(ordered) - 1)
    nearest: NDArray[np.int64] = order[after - (times - ordered[after - 1] < ordered[after] - times)]
    return nearest


def merge_notes(warnings: Sequence[str], steps: Sequence[str]) -> tuple[str, ...]:
    """Return the warnings of a file and how a record was read from it, without what both state."""
    clocks = any(step.startswith(_DIFFERENT) for step in steps)
    kept = [each for each in warnings if each not in steps and not (clocks and each.startswith(_DIFFERENT))]
    return (*kept, *steps)


def describe_clocks(names: Sequence[str], clocks: Sequence[ColumnClock], seconds: float | None) -> str:
    """Return the clocks of columns as text; ``seconds`` is the unit of their stamps, None for rows."""
    listed = ", ".join(
        f"{name} {_describe_step(own, seconds)}" for name, own in zip(names, clocks, strict=True)
    )
    return f"{_DIFFERENT}: {listed}"


def _describe_step(own: ColumnClock, seconds: float | None) -> str:
    if own.kind == "rows" and len(own.rows) == np.ptp(own.rows) + 1:
        return "in every row"
    text = f"every {own.step:.6g} rows" if seconds is None else f"every {own.step * seconds:.6g} s"
    return text + (" (held between them)" if own.kind == "held" else "")


def _describe(
    clocks: Sequence[ColumnClock],
    use: ColumnUse,
    slowest: int,
    clock: ColumnClock,
    recording: Recording,
) -> str:
    """Return the clocks of the columns, and how they were brought together."""
    step = clock.step
    text = describe_clocks(use.names, clocks, recording.seconds)
    text += f"; read at those of {use.names[slowest]}, every {step * recording.seconds:.6g} s"
    faster = [
        place
        for place, own in enumerate(clocks)
        if place not in use.outputs and own.step < (1 - SAME_STEP) * step
    ]
    signals = ", ".join(use.names[place] for place in faster if place in use.signals)
    inputs = ", ".join(use.names[place] for place in faster if place not in use.signals)
    if signals:
        text += f", with {_HOW[SAMPLE]} for {signals}"
    if inputs:
        other = SAMPLE if use.rates == MEAN else MEAN
        text += f", with {_HOW[use.rates]} for {inputs} (option rates: {other} takes {_HOW[other]}, "
        text += "rows every row as a sample)"
    else:
        text += " (option rates: rows takes every row as a sample)"
    return text
