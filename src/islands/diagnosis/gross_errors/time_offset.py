"""Corrections of an offset between the times of the input and the output."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from islands.diagnosis.gross_errors.correction import Correction, shift_signal
from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset

#: Longest delay of the output in samples that is an effect of the catalogue, and no gross error.
MAX_DELAY = 30

#: Largest offset, as a fraction of the shortest recording.
MAX_FRACTION = 0.25

#: Largest offset in samples.
MAX_OFFSET = 3000

#: Largest error of the best offset, relative to the error of the best delay that is no gross error.
MAX_ERROR_RATIO = 0.8


def correct_time_offset(record: Dataset, simulated: Signal, fitted: int) -> Iterator[Correction]:
    """Yield the record with the output moved by the offsets that fit best: none, one, or neighbours of one.

    An output that is earlier than the simulated one is impossible for a physical system. An output that is
    later by at most `MAX_DELAY` samples is delayed, which is an effect.

    Parameters
    ----------
    simulated : ndarray, shape (samples,)
        Output of the simulation as given.
    fitted : int
        Number of samples used for estimation.
    """
    if np.isnan(simulated).any():  # the simulation diverges
        return
    part = record[:fitted]
    limit = min(MAX_OFFSET, int(MAX_FRACTION * min(part.segments)))
    offsets = np.arange(-limit, limit + 1)
    errors = np.array([_compute_error(part, simulated[:fitted], int(offset)) for offset in offsets])
    is_delay = (offsets >= 0) & (offsets <= MAX_DELAY)
    if limit < 1 or not np.isfinite(errors).all() or is_delay.all():
        return
    candidates = np.where(is_delay, np.inf, errors)
    best = int(offsets[np.argmin(candidates)])
    if candidates.min() > MAX_ERROR_RATIO * errors[is_delay].min():
        return
    for offset in (best, best - 1, best + 1):
        if abs(offset) <= limit and not 0 <= offset <= MAX_DELAY:
            yield _move_output(record, offset)


def _move_output(record: Dataset, offset: int) -> Correction:
    """Return the record with the output moved back by a positive offset, in samples."""
    late, output, drive = offset > 0, record.output_name, record.input_names[0]
    seconds = abs(offset) * record.dt
    rows = f"{abs(offset)} row{'s' if abs(offset) > 1 else ''}"
    advice = f"Move column {output} {'up' if late else 'down'} by {rows} in the file."
    if offset == -1:
        advice = f"Give {drive}+1 as the input, which reads {drive} one sample early."
    return Correction(
        "time-offset",
        replace(record, **record.change_outputs(lambda y: shift_signal(y, offset, record.bounds))),
        f"The output {output} is recorded {seconds:.6g} s ({rows}) "
        + (
            f"later than {drive} drives it."
            if late
            else f"earlier than {drive} drives it, which is impossible."
        ),
        advice,
        {"offset": (offset * record.dt, "s"), "samples": (float(offset), "")},
        shift=offset,
        is_discrete=False,
    )


def _compute_error(record: Dataset, simulated: Signal, offset: int) -> float:
    """Return the mean squared error of an output that is later by an offset."""
    differences = []
    for first, last in record.bounds:
        begin, end = first + max(offset, 0), last + min(offset, 0)
        differences.append(record.y[begin:end] - simulated[begin - offset : end - offset])
    return float(np.nanmean(np.concatenate(differences) ** 2))
