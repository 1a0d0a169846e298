"""Linear state space of one output, its frequency response, and its modes in words."""

from cmath import log
from collections.abc import Iterable
from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True, eq=False)
class LinearSystem:
    """Linear system x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k).

    Attributes
    ----------
    a : ndarray, shape (states, states)
    b : ndarray, shape (states, inputs)
    c : ndarray, shape (states,)
    d : ndarray, shape (inputs,)
    """

    a: NDArray[np.float64]
    b: NDArray[np.float64]
    c: NDArray[np.float64]
    d: NDArray[np.float64]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles, the eigenvalues of A."""
        return np.linalg.eigvals(self.a).astype(np.complex128)

    def respond(self, frequencies: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the frequency response from every input.

        Parameters
        ----------
        frequencies : ndarray, shape (points,)
            In cycles per sample: 0.5 is the Nyquist frequency.

        Returns
        -------
        ndarray, shape (inputs, points)
            NaN at a frequency of an undamped mode.
        """
        found = np.empty((len(self.d), len(frequencies)), np.complex128)
        for place, frequency in enumerate(frequencies):
            z = np.exp(2j * pi * frequency)
            try:
                states = np.linalg.solve(z * np.eye(len(self.a)) - self.a, self.b)
            except np.linalg.LinAlgError:
                found[:, place] = np.nan
                continue
            found[:, place] = self.c @ states + self.d
        return found


def find_resonances(poles: Iterable[complex], dt: float) -> list[tuple[float, float]]:
    """Return the frequency in hertz and the damping ratio of every pair of complex poles, slowest first."""
    rates = [log(pole) / dt for pole in poles if pole.imag > 0.0]
    return sorted((abs(rate) / (2.0 * pi), -rate.real / abs(rate)) for rate in rates)


def describe_poles(poles: Iterable[complex], dt: float) -> tuple[str, ...]:
    """State the time constants and resonances of poles, slowest first."""
    ordered = sorted(map(complex, poles), key=lambda each: (-abs(each), -each.imag))
    return tuple(_describe_pole(pole, dt) for pole in ordered if pole.imag >= 0.0)


def _describe_pole(pole: complex, dt: float) -> str:
    if not pole:
        return "a delay of one sample"
    if pole.imag > 0.0:
        ((frequency, damping),) = find_resonances([pole], dt)
        return f"resonance at {frequency:.4g} Hz with a damping ratio of {damping:.3g}"
    if pole.real < 0.0:
        return f"an alternating mode (pole {pole.real:.4g})"
    if pole.real >= 1.0:
        return f"a mode that does not decay (pole {pole.real:.6g})"
    return f"time constant {-dt / log(pole).real:.4g} s"
