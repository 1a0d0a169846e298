"""Integration of the equations of a plant, and the inputs that drive it."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from lab.diagnosis.injection.excitation import Signal, multisine, random_noise

#: Right-hand side of a differential equation: ``(time, state, input) -> derivatives``.
RightHandSide = Callable[[float, tuple[float, ...], float], tuple[float, ...]]

#: Samples of a record of a machine and of a process.
MACHINE_SAMPLES, PROCESS_SAMPLES = 2000, 1500

#: Sampling times in seconds of a machine and of a process.
MACHINE_DT, PROCESS_DT = 0.005, 0.1

#: Steps of the integration per sample of a machine and of a process.
MACHINE_STEPS, PROCESS_STEPS = 10, 5

#: Highest frequency of the force in Hz, and the largest force in N.
BAND, PEAK_FORCE = 16.0, 20.0

#: Part of a record by which the integration goes on after its end, for fast clocks.
_MARGIN = 0.01

#: Largest input of a process, and the range of the durations in samples for which it is constant.
PEAK_INPUT, _HELD = 2.0, (15, 70)


def integrate(
    equation: RightHandSide, start: tuple[float, ...], u: Signal, step: float, is_held: bool = False
) -> Signal:
    """Integrate by the Runge-Kutta method of fourth order.

    The input is linear within a step, or constant if it is held.

    Returns
    -------
    ndarray, shape (u.size, states)
    """
    state, inputs, half = start, u.tolist(), step / 2
    found = [state]
    for index, (now, following) in enumerate(pairwise(inputs)):
        after = now if is_held else following
        time, middle = index * step, (now + after) / 2
        first = equation(time, state, now)
        second = equation(time + half, _advance(state, first, half), middle)
        third = equation(time + half, _advance(state, second, half), middle)
        fourth = equation(time + step, _advance(state, third, step), after)
        state = tuple(
            x + step * (a + 2 * (b + c) + d) / 6
            for x, a, b, c, d in zip(state, first, second, third, fourth, strict=True)
        )
        found.append(state)
    return np.array(found)


def _advance(state: tuple[float, ...], slope: tuple[float, ...], step: float) -> tuple[float, ...]:
    return tuple(x + step * rate for x, rate in zip(state, slope, strict=True))


def draw_force(rng: np.random.Generator) -> Signal:
    """Draw a force at the steps of the integration: a multisine or low-pass noise, from rest.

    It is longer than the record by `_MARGIN`.
    """
    rate = MACHINE_STEPS / MACHINE_DT
    count = int(MACHINE_SAMPLES * MACHINE_STEPS * (1 + _MARGIN))
    use_noise = bool(rng.integers(2))
    u = random_noise(rng, count, rate, BAND, 1.0) if use_noise else multisine(rng, count, rate, BAND)
    u = u * np.minimum(1.0, np.arange(count) / (0.1 * rate))
    return PEAK_FORCE * u / np.max(np.abs(u))


def draw_levels(rng: np.random.Generator, low: float = -PEAK_INPUT, high: float = PEAK_INPUT) -> Signal:
    """Draw random levels, each held for a random time, at the samples; the first one is zero."""
    lengths = rng.integers(*_HELD, PROCESS_SAMPLES // _HELD[0] + 1)
    levels = rng.uniform(low, high, lengths.size)
    levels[0] = 0.0
    return np.repeat(levels, lengths)[:PROCESS_SAMPLES]


def hold(u: Signal) -> Signal:
    """Return an input at the steps of the integration that is constant within each sample."""
    return np.repeat(u, PROCESS_STEPS)
