"""Ranges of signals and of their rates, in which a simulation was tested, and which another record leaves."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from islands.records.dataset import Dataset
from islands.records.segments import map_segments

#: Excess of a range, as a part of its width, that does not count.
NEGLIGIBLE_EXCESS = 0.05

#: Ratio of the largest rates that does not count: the largest one of noise differs between records.
NEGLIGIBLE_RATIO = 1.2


class RangeLike(Protocol):
    """Attributes of `SignalRange`, which a document has too."""

    @property
    def name(self) -> str: ...  # noqa: D102 - of SignalRange
    @property
    def unit(self) -> str: ...  # noqa: D102
    @property
    def low(self) -> float: ...  # noqa: D102
    @property
    def high(self) -> float: ...  # noqa: D102
    @property
    def rate(self) -> float: ...  # noqa: D102


@dataclass(frozen=True, slots=True)
class SignalRange:
    """Range of a signal.

    Attributes
    ----------
    name, unit : str
    low, high : float
    rate : float
        Largest absolute rate of change, per second.
    """

    name: str
    unit: str
    low: float
    high: float
    rate: float


def measure_ranges(record: Dataset, output: NDArray[np.float64]) -> tuple[SignalRange, ...]:
    """Return the ranges of the inputs of a record and of an output; missing samples do not count."""
    names = (*record.input_names, record.output_name)
    units = (*record.input_units, record.output_unit)
    return tuple(
        _measure_range(name, unit, signal, record)
        for name, unit, signal in zip(names, units, (*record.u.T, output), strict=True)
    )


def _measure_range(name: str, unit: str, signal: NDArray[np.float64], record: Dataset) -> SignalRange:
    known = signal[np.isfinite(signal)]
    rates = np.abs(map_segments(np.diff, signal, record.segments)) / record.dt
    rate = float(rates[np.isfinite(rates)].max(initial=0.0))
    if not known.size:  # the simulation has diverged
        return SignalRange(name, unit, np.nan, np.nan, rate)
    return SignalRange(name, unit, float(known.min()), float(known.max()), rate)


def compare_ranges(tested: Sequence[RangeLike], found: Sequence[RangeLike]) -> list[str]:
    """State every signal whose range or rate in a record leaves that in which a simulation was tested.

    Signals that were not tested, such as further channels, do not count.
    """
    known, statements = {each.name: each for each in tested}, []
    for each in found:
        if (limits := known.get(each.name)) is None:
            continue
        name, unit = each.name, limits.unit or each.unit
        allowed = NEGLIGIBLE_EXCESS * (limits.high - limits.low)
        if each.low < limits.low - allowed or each.high > limits.high + allowed:
            statements.append(
                f"{name} is {each.low:.4g} to {each.high:.4g} {unit}".rstrip()
                + f" in the record, and was {limits.low:.4g} to {limits.high:.4g} {unit}".rstrip()
                + " where the extended simulation was tested"
            )
        if each.rate > NEGLIGIBLE_RATIO * limits.rate:
            statements.append(
                f"{name} changes by up to {each.rate:.4g} {unit or '1'}/s in the record, and by up to "
                f"{limits.rate:.4g} {unit or '1'}/s where the extended simulation was tested"
            )
    return statements
