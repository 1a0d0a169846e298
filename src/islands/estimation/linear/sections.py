"""Denominators of linear models as sections of first and second order, and their responses.

A section ``1 + a1 q^-1 + a2 q^-2`` has two real poles or a complex pair, and its coefficients pass smoothly
from one to the other through a double pole. The responses of parallel sections stay independent up to high
orders, where those of one polynomial do not.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import copysign, sqrt

import numpy as np
from numpy.typing import NDArray

Signal = NDArray[np.float64]

#: Coefficients of a section after the leading 1, shape (1,) or (2,).
Section = Signal

#: Samples of a block of a long record.
BLOCK = 8192

#: Least distance of real poles of different sections, as a part of their rate. The residues of six such poles
#: have eleven digits more than the response, which differs from that of equal poles by the square of it.
_DISTANCE = 5e-3

#: The sections of no pole at exactly 1, of one, and of two.
INTEGRATORS: tuple[tuple[Section, ...], ...] = (), (np.array([-1.0]),), (np.array([-2.0, 1.0]),)


@dataclass(frozen=True, eq=False)
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

    @cached_property
    def first(self) -> Signal:
        """First values of the inputs of every recording, shape (recordings, inputs)."""
        return np.ascontiguousarray(self.u[:, [begin for begin, _ in self.bounds]].T)

    def keep(self, begin: int, end: int) -> "Signals":
        """Return the samples of an interval."""
        ends = np.clip(self.ends, begin, end) - begin
        u, y = (np.ascontiguousarray(each[:, begin:end]) for each in (self.u, self.y))
        return Signals(u, y, np.unique(ends[ends > 0]))


def pair_poles(poles: Iterable[complex]) -> list[Section]:
    """Return the sections of poles: every complex pair, and neighbours among the real poles.

    Real poles of different sections that coincide are moved apart: their residues would be infinite.
    """
    every = [complex(pole) for pole in poles]
    sections = [np.array([-2.0 * pole.real, abs(pole) ** 2]) for pole in every if pole.imag > 0.0]
    real = sorted((pole.real for pole in every if pole.imag == 0.0), reverse=True)
    for place in range(2, len(real)):
        slower = max(real[place - 1], 0.0) ** (1.0 + _DISTANCE)
        real[place] = min(real[place], slower) if place % 2 == 0 else min(real[place], real[place - 1])
    pairs = zip(real[::2], real[1::2], strict=False)
    sections += [np.array([-one - other, one * other]) for one, other in pairs]
    return [*sections, *(np.array([-real[-1]]) for _ in range(len(real) % 2))]


def find_poles(sections: Sequence[Section]) -> NDArray[np.complex128]:
    """Return the poles of sections."""
    return np.array([pole for section in sections for pole in _find_roots(*section.tolist())], np.complex128)


def find_point_poles(points: Sequence[Sequence[Section]]) -> NDArray[np.complex128]:
    """Return the poles of sections of several systems of equal orders, shape (points, order)."""
    if len(points) == 1:
        return find_poles(points[0])[None]
    columns = []
    for sections in zip(*points, strict=True):
        first, *last = np.array(sections).T
        if not last:
            columns.append(-first)
            continue
        middle, square = -0.5 * first, 0.25 * first * first - last[0]
        root, is_pair = np.sqrt(np.abs(square)), square < 0.0
        larger = middle + np.copysign(root, middle)
        smaller = np.divide(last[0], larger, out=np.zeros_like(larger), where=larger != 0.0)
        columns += [
            np.where(is_pair, middle + 1j * root, larger),
            np.where(is_pair, middle - 1j * root, smaller),
        ]
    return np.array(columns, np.complex128).reshape(-1, len(points)).T


def _find_roots(first: float, last: float | None = None) -> tuple[complex, ...]:
    """Return the poles of a section."""
    if last is None:
        return (-first,)
    middle, square = -0.5 * first, 0.25 * first * first - last
    if square < 0.0:
        pole = complex(middle, sqrt(-square))
        return pole, pole.conjugate()
    # A sum of numbers of one sign; the difference of others would lose digits of the smaller pole.
    larger = middle + copysign(sqrt(square), middle)
    return larger, last / larger if larger else 0.0


def is_stable(section: Section) -> bool:
    """Return whether the poles of a section are inside of the unit circle."""
    last = section[-1] if section.size == 2 else 0.0
    return bool(abs(last) < 1.0 and abs(section[0]) < 1.0 + last)
