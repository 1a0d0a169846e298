"""Correction of a gross error: the record as it would be without the error."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from islands.effects.interface.context import Signal
from islands.records.dataset import Dataset


@dataclass(frozen=True, slots=True, eq=False)
class Correction:
    """A record without a gross error that it may have.

    Attributes
    ----------
    name : str
        Name of the gross error.
    record : Dataset
        The corrected record, with as many samples.
    description : str
        The gross error, as a sentence.
    advice : str
        How to correct it, as a sentence.
    parameters : mapping
        Values of the error by name, each with its unit.
    scale : float
        Factor from the recorded output to the corrected one.
    shift : int
        Number of samples by which the recorded output is later than the corrected one.
    has_other_output : bool
        Whether the corrected output is another signal than the recorded one.
    is_discrete : bool
        Whether the error has one of a few values. Another error, such as an offset of the time, is found by a
        search, and has to explain more than simulations without any tolerance.
    """

    name: str
    record: Dataset
    description: str
    advice: str
    parameters: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    scale: float = 1.0
    shift: int = 0
    has_other_output: bool = False
    is_discrete: bool = True

    @property
    def is_known(self) -> NDArray[np.bool_]:
        """Whether the corrected output of each sample is in the record, shape (samples,)."""
        known = np.ones(self.record.samples, dtype=bool)
        for first, last in self.record.bounds:
            known[max(first, last - max(self.shift, 0)) : last] = False
            known[first : min(last, first + max(-self.shift, 0))] = False
        return known

    def restore(self, simulated: Signal) -> Signal:
        """Return a simulation of the corrected record in the unit and at the time of the recorded output."""
        return shift_signal(simulated, -self.shift, self.record.bounds) / self.scale


def shift_signal(signal: Signal, samples: int, bounds: tuple[tuple[int, int], ...]) -> Signal:
    """Move a signal forward in time within each recording: ``signal[k + samples]``; the ends are held."""
    shifted = np.empty_like(signal)
    for first, last in bounds:
        shifted[first:last] = signal[np.clip(np.arange(first, last) + samples, first, last - 1)]
    return shifted
