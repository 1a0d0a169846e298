"""Denominators of linear models as sections of first and second order, and their responses.

A section ``1 + a1 q^-1 + a2 q^-2`` has two real poles or a complex pair, and its coefficients pass smoothly
from one to the other through a double pole. The responses of parallel sections stay independent up to high
orders, where those of one polynomial do not.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from islands.kernels.linear_filter import divide_rows

Signal = NDArray[np.float64]

#: Coefficients of a section after the leading 1, shape (1,) or (2,).
Section = Signal

#: Samples of a block of a long record.
BLOCK = 8192

#: The section of a pole at exactly 1.
INTEGRATOR: Section = np.array([-1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """Scaled inputs and outputs of consecutive recordings.

    Attributes
    ----------
    u : ndarray, shape (inputs, samples)
    y : ndarray, shape (outputs, samples)
    ends : ndarray of int64, shape (recordings,)
        Sample after the last one of every recording.
    """

    u: Signal
    y: Signal
    ends: NDArray[np.int64]

    @property
    def bounds(self) -> list[tuple[int, int]]:
        """First sample of every recording, and the sample after its last one."""
        ends = self.ends.tolist()
        return list(zip([0, *ends[:-1]], ends, strict=True))

    @property
    def samples(self) -> int:
        """Number of samples."""
        return int(self.y.shape[1])

    @property
    def rest(self) -> NDArray[np.int64]:
        """Samples for which every input keeps the first value of a recording, at least, shape (inputs,)."""
        kept = [
            [int(np.argmax(np.append(x[begin:end] != x[begin], True))) for x in self.u]
            for begin, end in self.bounds
        ]
        least: NDArray[np.int64] = np.min(np.array(kept, np.int64), axis=0)
        return least

    def keep(self, begin: int, end: int) -> "Signals":
        """Return the samples of an interval."""
        ends = np.clip(self.ends, begin, end) - begin
        return Signals(self.u[:, begin:end], self.y[:, begin:end], np.unique(ends[ends > 0]))

    def late(self, place: int, delay: int) -> Signal:
        """Return an input a number of samples later; before a recording it has its first value."""
        late = np.empty(self.samples)
        for begin, end in self.bounds:
            middle = min(begin + delay, end)
            late[begin:middle] = self.u[place, begin]
            late[middle:end] = self.u[place, begin : begin + end - middle]
        return late


def pair_poles(poles: Iterable[complex]) -> list[Section]:
    """Return the sections of poles: every complex pair, and neighbours among the real poles."""
    every = [complex(pole) for pole in poles]
    sections = [np.array([-2.0 * pole.real, abs(pole) ** 2]) for pole in every if pole.imag > 0.0]
    real = sorted((pole.real for pole in every if pole.imag == 0.0), reverse=True)
    pairs = zip(real[::2], real[1::2], strict=False)
    sections += [np.array([-one - other, one * other]) for one, other in pairs]
    return [*sections, *(np.array([-real[-1]]) for _ in range(len(real) % 2))]


def find_poles(sections: Sequence[Section]) -> NDArray[np.complex128]:
    """Return the poles of sections."""
    found = [np.roots([1.0, *section]) for section in sections]
    return np.concatenate([np.zeros(0), *found]).astype(np.complex128)


def is_stable(section: Section) -> bool:
    """Return whether the poles of a section are inside of the unit circle."""
    last = section[-1] if section.size == 2 else 0.0
    return bool(abs(last) < 1.0 and abs(section[0]) < 1.0 + last)


def divide(section: Section, rows: Signal, ends: NDArray[np.int64]) -> Signal:
    """Return rows divided by a section, one sample late and, of two coefficients, the difference to the next.

    Returns
    -------
    ndarray, shape (rows, coefficients, samples)
        Values at sample k are ``v(k-1)`` and ``v(k-1) - v(k-2)``, from rest at the start of a recording.
    """
    divided = divide_rows(section, rows, ends)
    found = np.zeros((len(rows), section.size, rows.shape[1]))
    found[:, 0, 1:] = divided[:, :-1]
    found[:, 0, _starts(ends)] = 0.0
    if section.size == 2:
        found[:, 1, 1:] = found[:, 0, 1:] - found[:, 0, :-1]
        found[:, 1, _starts(ends)] = 0.0
    return found


def respond_freely(sections: Sequence[Section], length: int) -> Signal:
    """Return the responses to initial states, shape (order, samples)."""
    pulse = np.zeros((1, length + 1))
    pulse[0, 0] = 1.0
    ends = np.array([length + 1])
    found = [divide(section, pulse, ends)[0, :, 1:] for section in sections]
    return np.concatenate([np.zeros((0, length)), *found])


def _starts(ends: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([[0], ends[:-1]])
