"""Whether output over input is a loop at low frequency, as that of a hysteresis is.

Delays, time constants and integrators make loops, too, but those of the first two close as the input becomes
slower. Three regressions predict the output of other parts of the record: one from the input, its low-pass
filtered copies and their powers; one also from the integral of the input; one also from play operators of the
input, whose loops do not depend on time. If the last one predicts clearly better, the loop remains at low
frequency. A record of one repeated loop does not separate them in this way: there, the output of a hysteresis
turns together with the input, and that behind a delay turns as late as its loop is wide.
"""

from itertools import pairwise
from math import pi

import numpy as np
from numpy.typing import NDArray

from islands.records.averaging import average_samples
from islands.records.dataset import Dataset
from islands.records.flat_extremes import TWO
from islands.records.inspection.blocks import assign_blocks, resample, sum_blocks
from islands.records.inspection.fact import Fact
from islands.records.loops import has_loops, loop_starts, measure_area
from islands.records.segments import delay_samples

#: Samples of a loop and of a record that are compared, about.
_LOOP_SAMPLES, _SAMPLES = 100, 6000

#: Time constants of the low-pass filters in samples, and powers of their outputs.
_TIME_CONSTANTS, _POWERS = (1.0, 3.0, 10.0, 30.0, 100.0), 3

#: Half widths of the play operators, relative to the range of the input.
_WIDTHS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)

#: Folds that are predicted in turn, and assumed accuracy of a column.
_FOLDS, _ACCURACY = 4, 1e-4

#: Part of the squared error that the play operators, or the integral, remove, at least.
_LEAST_GAIN = 0.4

#: Squared error, relative to the variance of the output, below which delays and time constants explain it.
_EXPLAINED = 5e-3

#: Squared error, relative to the variance of the output, above which neither regression describes the record.
_FAR = 0.1

#: Delay of the turning points, relative to the phase shift of the loop's width: largest one of a hysteresis,
#: smallest one of a delay.
_TOGETHER, _LATE = 0.3, 0.6

#: Smallest phase shift of a loop's width, in samples, that can be compared with the delay of the output.
_LEAST_SHIFT = 3.0

#: Part of the range of the input around a turning point, and samples, in which the output turns.
_TIP, _LEAST_TIP = 0.1, 5


def check_loop(record: Dataset, place: int) -> Fact:
    """Return whether the output over an input is a loop that remains at low frequency.

    Parameters
    ----------
    record : Dataset
        Other inputs are ignored.
    place : int
        Index of the input, from 0.

    Returns
    -------
    Fact
        A yes or no; None if the input does not rise and fall slowly enough for a loop, or has two levels, in
        which a hysteresis does not differ from a time constant. The confidence is the share of resampled
        records with the same answer.
    """
    name, single = record.input_names[place], _take_input(record, place)
    finding, loop, share, longest = "loop_none", None, None, None
    if single is None or np.ptp(single.u) == 0.0 or not np.isfinite(single.y).all():
        finding = "loop_not_judged"
    elif np.unique(single.u).size == TWO:
        finding = "loop_two_levels"
    elif len(loop_starts(slow := average_samples(single, _choose_count(single)))) < 2:
        finding, longest = "loop_no_cycles", None if len(record.bounds) == 1 else single.samples
    elif not has_loops(slow):
        loop = False
    else:
        loop, share = _judge(slow)
        finding = {None: "loop_undecided", True: "loop_hysteresis", False: "loop_dynamics"}[loop]
    details = {"output": record.output_name, "longest": longest}
    return Fact("loop", name, finding, loop, confidence=share, details=details)


def _judge(record: Dataset) -> tuple[bool | None, float | None]:
    """Return whether a hysteresis makes the loops of a slow record, with a confidence."""
    filtered, without, with_plays = _predict(record)
    better, integrates = _count_gains(without, with_plays), _count_gains(filtered, without)
    if not _is_regular(record):
        if integrates > 0.5 >= better:
            return False, min(integrates, 1.0 - better)
        explained = _EXPLAINED * record.samples < without.sum() and with_plays.sum() < _FAR * record.samples
        if better > 0.5 or explained:
            return better >= 0.5, max(better, 1.0 - better)
    late = _compare_tips(record)
    if not late.size:
        return None, None
    together, delayed = float(np.mean(late <= _TOGETHER)), float(np.mean(late >= _LATE))
    if max(together, delayed) <= 0.5:
        return None, None
    return together > delayed, max(together, delayed)


def _count_gains(without: NDArray[np.float64], with_columns: NDArray[np.float64]) -> float:
    """Return the share of resampled records in which further columns remove the error for the most part."""
    gains = 1.0 - resample(with_columns) / np.maximum(resample(without), np.finfo(np.float64).tiny)
    return float(np.mean(gains >= _LEAST_GAIN))


def _is_regular(record: Dataset) -> bool:
    """Return whether all loops have about the same duration and width."""
    loops = list(pairwise(loop_starts(record)))
    durations = np.array([last - first for first, last in loops], dtype=np.float64)
    widths = np.array([np.ptp(record.u[first:last, 0]) for first, last in loops])
    return all(np.ptp(size) <= 0.2 * np.median(size) for size in (durations, widths))


def _compare_tips(record: Dataset) -> NDArray[np.float64]:
    """Return how late the output turns in every loop, relative to the phase shift of the loop's width.

    The loop of a sine and the sine shifted by an angle covers pi/4 sin(angle) of the rectangle around it.
    """
    u, found = record.u[:, 0], []
    y = record.y * np.sign(np.sum((u - u.mean()) * (record.y - record.y.mean())))
    for first, last in pairwise(loop_starts(record)):
        width = np.arcsin(min(1.0, 4.0 / pi * measure_area(u[first:last], y[first:last])))
        delays = []
        for sign in (1.0, -1.0):
            turn = first + int(np.argmax(sign * u[first:last]))
            near = np.flatnonzero(sign * (u[turn] - u[first:last]) <= _TIP * np.ptp(u[first:last]))
            half = max(int(np.ptp(near)) // 2, _LEAST_TIP)
            part = np.arange(max(turn - half, 0), min(turn + 2 * half + 1, u.size))
            delays.append(part[int(np.argmax(sign * _smooth(y[part])))] - turn)
        shift = width * (last - first) / (2.0 * pi)
        if shift >= _LEAST_SHIFT:
            found.append(float(np.mean(delays)) / shift)
    return np.array(found)


def _smooth(y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return means of three samples; both ends are repeated."""
    padded = np.pad(y, 1, mode="edge")
    means: NDArray[np.float64] = (padded[:-2] + padded[1:-1] + padded[2:]) / 3.0
    return means


def _take_input(record: Dataset, place: int) -> Dataset | None:
    """Return the record with one input, and with its longest segment only."""
    begin, end = max(record.bounds, key=lambda bounds: bounds[1] - bounds[0])
    part = slice(begin, end)
    return Dataset(record.u[part, place], record.y[part], record.dt) if end - begin > 1 else None


def _choose_count(record: Dataset) -> int:
    """Return how many samples are averaged: loops of about 100 means, and a record of some thousand."""
    starts = loop_starts(record)
    length = float(np.median(np.diff(starts))) if len(starts) > 1 else 0.0
    return max(1, int(length) // _LOOP_SAMPLES, -(-record.samples // _SAMPLES) if length >= 50 else 1)


def _predict(record: Dataset) -> list[NDArray[np.float64]]:
    """Return the squared errors of all blocks without the integral, without the plays, and with both."""
    u = record.u[:, 0] - record.u[0, 0]
    u = u / np.ptp(u)
    filtered = [u, *(_filter(u, constant) for constant in _TIME_CONSTANTS)]
    lagged = [delay_samples(u, lag) for lag in (1, 2, 4, 8)]
    smooth = [signal**power for signal in filtered + lagged for power in range(1, 1 + _POWERS)]
    plays = [_apply_play(u, width) for width in _WIDTHS]
    trend = np.linspace(-1.0, 1.0, u.size)
    columns = np.array([np.ones(u.size), trend, *smooth, np.cumsum(u - u.mean()), *plays])
    scale = np.sqrt(np.mean(columns**2, axis=1))
    columns /= np.where(scale > 0.0, scale, 1.0)[:, None]
    y = (record.y - record.y.mean()) / record.y.std()
    counts = (len(columns) - len(plays) - 1, len(columns) - len(plays), len(columns))
    return [_measure_errors(columns[:count], y) for count in counts]


def _apply_play(u: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """Apply a play operator. For some thousand samples, loading the compiled kernel would take longer."""
    output, at = [], float(u[0])
    for value in u.tolist():
        at = max(min(at, value + width), value - width)
        output.append(at)
    return np.array(output)


def _filter(u: NDArray[np.float64], constant: float) -> NDArray[np.float64]:
    """Return a signal behind a first-order low-pass filter in the steady state of its first value.

    For some thousand samples, importing `scipy.signal` would take longer.
    """
    decay = float(np.exp(-1.0 / constant))
    output, at = [], float(u[0])
    for value in u.tolist():
        at = (1.0 - decay) * value + decay * at
        output.append(at)
    return np.array(output)


def _measure_errors(columns: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    block = assign_blocks(y.size)
    fold = block % _FOLDS
    errors = np.empty(y.size)
    ridge = _ACCURACY**2 * y.size * np.eye(len(columns))
    for each in range(_FOLDS):
        known, held = fold != each, fold == each
        x = columns[:, known]
        weights = np.linalg.solve(np.einsum("ir,jr->ij", x, x) + ridge, np.einsum("ir,r->i", x, y[known]))
        errors[held] = y[held] - np.einsum("ir,i->r", columns[:, held], weights)
    return sum_blocks(errors**2)
