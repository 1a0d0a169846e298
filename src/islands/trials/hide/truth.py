"""The truth: a piezo actuator whose every part may be another one than the simulation takes it for."""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from islands.trials.hide.excitation import RATE, Drive, Signal

#: Takes what drives the truth and a signal, and gives the signal as it really is.
Map = Callable[[Drive, Signal], Signal]

#: Takes what drives it, the voltage that acts and its rate, and gives a displacement.
Addition = Callable[[Drive, Signal, Signal], Signal]


@dataclass(frozen=True, slots=True)
class Truth:
    """A Bouc-Wen actuator with whatever was hidden in it.

    Attributes
    ----------
    A, beta, gamma, dp : float
        As in the paper's equation (11).
    decay : float
        Of the hysteretic state, 1/s.
    hurry : float
        By how much the loop's shape grows with the rate, s/V.
    lean : float
        Asymmetry of the loop, 1/V.
    gain : callable or None
        Of time: what ``dp`` is multiplied by.
    before, beside, behind : tuple
        What acts on the input, beside the actuator, and on its output, in this order.
    """

    A: float = 0.9
    beta: float = 0.008
    gamma: float = 0.008
    dp: float = 1.6
    decay: float = 0.0
    hurry: float = 0.0
    lean: float = 0.0
    gain: Callable[[Signal], Signal] | None = None
    before: tuple[Map, ...] = field(default=())
    beside: tuple[Addition, ...] = field(default=())
    behind: tuple[Map, ...] = field(default=())


def respond(truth: Truth, drive: Drive) -> Signal:
    """Return what the truth does, at its own rate, shape (samples,), in um."""
    x = drive.u
    for change in truth.before:
        x = change(drive, x)
    y = truth.dp * x
    if truth.gain is not None:
        y = y * truth.gain(drive.time)
    y = y - np.array(_hysteresis(truth, x.tolist()))
    if truth.beside:
        rate = np.gradient(x) * RATE
        for addition in truth.beside:
            y = y + addition(drive, x, rate)
    for change in truth.behind:
        y = change(drive, y)
    return y


def _hysteresis(truth: Truth, x: list[float]) -> list[float]:
    """Integrate the hysteretic state by Heun's method, a millisecond at a time."""
    states, state = [0.0], 0.0

    def slope(h: float, du: float) -> float:
        shape = 1.0 + truth.hurry * abs(du) * RATE
        return (
            truth.A * du
            - shape * (truth.beta * abs(du) * h + truth.gamma * du * abs(h))
            - truth.decay * h / RATE
            - truth.lean * abs(du) * abs(h)
        )

    for here, there in pairwise(x):
        du = there - here
        first = slope(state, du)
        state += (first + slope(state + first, du)) / 2
        states.append(state)
    return states
