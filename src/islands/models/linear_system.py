"""Linear state space of one output, its frequency response, and its modes in words."""

from cmath import log
from collections.abc import Iterable, Sequence
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

    @property
    def static_gains(self) -> NDArray[np.float64]:
        """Output at rest for a constant unit of every input, shape (inputs,); NaN for an integrator."""
        gains: NDArray[np.float64]
        try:
            gains = self.c @ np.linalg.solve(np.eye(len(self.a)) - self.a, self.b) + self.d
        except np.linalg.LinAlgError:
            return np.full(len(self.d), np.nan)
        return gains

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


@dataclass(frozen=True, slots=True)
class Quantity:
    """A property of a linear system that does not depend on the coordinates of the states.

    Attributes
    ----------
    name : str
        ``time constant``, ``frequency``, ``damping ratio``, ``pole`` or ``static gain``.
    value : float
    unit : str
        ``s`` or ``Hz``; empty for a number, and for a gain, whose unit is that of the output by that of the
        input.
    input : int or None
        Number of the input of a gain, from 1.
    """

    name: str
    value: float
    unit: str = ""
    input: int | None = None


def list_modes(poles: Iterable[complex]) -> list[complex]:
    """Return the real poles, and of each pair of complex ones that above the real axis, slowest first."""
    ordered = sorted(map(complex, poles), key=lambda each: (-abs(each), -each.imag))
    return [pole for pole in ordered if pole.imag >= 0.0]


def measure_mode(pole: complex, dt: float) -> tuple[Quantity, ...]:
    """Return the quantities of a mode: a time constant, or frequency and damping ratio; none of a delay."""
    if not pole:
        return ()
    if pole.imag > 0.0:
        ((frequency, damping),) = find_resonances([pole], dt)
        return Quantity("frequency", frequency, "Hz"), Quantity("damping ratio", damping)
    if not 0.0 < pole.real < 1.0:
        return (Quantity("pole", pole.real),)
    return (Quantity("time constant", -dt / log(pole).real, "s"),)


def measure_gains(system: LinearSystem) -> tuple[Quantity, ...]:
    """Return the static gain of every input."""
    gains = enumerate(system.static_gains.tolist(), start=1)
    return tuple(Quantity("static gain", gain, input=place) for place, gain in gains)


def describe_poles(
    poles: Iterable[complex], dt: float, errors: Sequence[float] | None = None
) -> tuple[str, ...]:
    """State the time constants and resonances of poles, slowest first.

    Parameters
    ----------
    poles : iterable of complex
    dt : float
        Sampling time in seconds.
    errors : sequence of float, optional
        Standard errors of the quantities of all modes, one mode after the other.
    """
    texts, left = [], list(errors or ())
    for pole in list_modes(poles):
        quantities = measure_mode(pole, dt)
        own, left = left[: len(quantities)], left[len(quantities) :]
        texts.append(_describe_pole(pole, dt, [write_error(each) for each in own] or [""] * 2))
    return tuple(texts)


def write_error(error: float) -> str:
    """Write a standard error after its value."""
    return f" +- {error:.2g}"


def _describe_pole(pole: complex, dt: float, errors: Sequence[str]) -> str:
    if not pole:
        return "a delay of one sample"
    first, *others = measure_mode(pole, dt)
    if others:
        frequency = f"{first.value:.4g}{errors[0]} Hz"
        return f"resonance at {frequency} with a damping ratio of {others[0].value:.3g}{errors[1]}"
    if first.name == "time constant":
        return f"time constant {first.value:.4g}{errors[0]} s"
    if pole.real < 0.0:
        return f"an alternating mode (pole {pole.real:.4g}{errors[0]})"
    return f"a mode that does not decay (pole {pole.real:.6g}{errors[0]})"
