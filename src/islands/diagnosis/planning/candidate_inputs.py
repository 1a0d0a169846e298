"""Candidate inputs of the next experiment: those within what a record has shown, and those beyond it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, pi

import numpy as np

from islands.diagnosis.planning.planned_input import (
    MIN_REPEATS,
    MIN_SAMPLES,
    InputForm,
    InputLimits,
    PlannedInput,
    find_rate,
)
from islands.effects.interface.context import Signal
from islands.rounding import ROUNDING

#: Factor of the range of a smaller input.
SMALLER = 0.5

#: Factors of the speed and of the range of inputs beyond those of a record.
FASTER, LARGER = (2, 4, 8, 16), (1.5, 2.0)

#: Places of frequencies between the lowest and the highest one of an input, on a logarithmic scale.
_PLACES = (0.3, 0.7)


@dataclass(frozen=True, slots=True, eq=False)
class CandidateInput:
    """An input that may separate causes.

    Attributes
    ----------
    description : str
    u : ndarray, shape (samples,)
    """

    description: str
    u: Signal


def list_inputs_within(u: Signal, dt: float, limits: InputLimits, unit: str) -> list[CandidateInput]:
    """List inputs within limits: holds, a slow triangle wave, a sweep, multisines, and a smaller input.

    Parameters
    ----------
    u : ndarray, shape (samples,)
        Recorded input; the candidates have its length.
    limits : InputLimits
    unit : str
        Unit of the input.
    """
    smaller = CandidateInput(f"the same input {SMALLER:g} times as large", _scale(u, SMALLER))
    return [*_list_forms(u.size, dt, limits, unit), smaller]


def list_inputs_beyond(u: Signal, dt: float, limits: InputLimits, unit: str) -> list[CandidateInput]:
    """List inputs that exceed the rate or the range of limits: faster ones, and larger ones."""
    places = np.arange(u.size)
    faster = [
        CandidateInput(f"the same input {factor} times as fast", u[(factor * places) % u.size])
        for factor in FASTER
    ]
    larger = [
        CandidateInput(f"the same input {factor:g} times as large", _scale(u, factor)) for factor in LARGER
    ]
    free = _list_forms(u.size, dt, replace(limits, rate=inf), unit)
    return [each for each in (*faster, *free, *larger) if not limits.contains(each.u, dt)]


def _scale(u: Signal, factor: float) -> Signal:
    middle = (float(np.max(u)) + float(np.min(u))) / 2
    scaled: Signal = middle + factor * (u - middle)
    return scaled


def _list_forms(samples: int, dt: float, limits: InputLimits, unit: str) -> Iterator[CandidateInput]:
    duration = samples * dt
    lowest, highest = MIN_REPEATS / duration, 1.0 / (MIN_SAMPLES * dt)
    # A faster sine of this amplitude would exceed the rate.
    fastest = min(highest, limits.rate / (2 * pi * limits.amplitude))
    frequencies = [lowest * (highest / lowest) ** place for place in _PLACES]
    planned = [PlannedInput(InputForm.TRIANGLE, 1.0, lowest)]
    if fastest > lowest:
        planned.append(PlannedInput(InputForm.SWEEP, 1.0, fastest, 1.0 / duration))
    planned += [PlannedInput(InputForm.STEPS, 1.0, each) for each in frequencies]
    planned += [PlannedInput(InputForm.MULTISINE, 1.0, each, 1.0 / duration) for each in frequencies]
    for each in planned:
        signal = each.make(limits, dt, samples)
        # A limited rate reduces the amplitude.
        share = float(np.ptp(signal)) / (2 * limits.amplitude)
        yield CandidateInput(replace(each, share=share).describe(limits, unit), signal)


def find_excess(u: Signal, dt: float, limits: InputLimits) -> tuple[float, float]:
    """Return by which factors the range and the rate of an input exceed limits; 1 within them."""
    reach = max(float(np.max(u)) - limits.middle, limits.middle - float(np.min(u))) / limits.amplitude
    rate = find_rate(u, dt) / limits.rate
    return (reach if reach > 1.0 + ROUNDING else 1.0), (rate if rate > 1.0 + ROUNDING else 1.0)
