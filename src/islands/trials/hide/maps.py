"""Maps of a signal, as they may be hidden: what acts before the actuator on its input, or behind it.

Each takes chance and a strength, and gives what is done to a signal.
"""

import numpy as np
import scipy

from islands.trials.hide.excitation import OUTPUT, PEAK, RATE, Drive, Signal
from islands.trials.hide.truth import Map


def sign(rng: np.random.Generator) -> float:
    """Draw a sign."""
    return float(rng.choice([-1.0, 1.0]))


def later(_rng: np.random.Generator, tau: float) -> Map:
    """Delay."""
    return lambda drive, u: np.interp(drive.time - tau, drive.time, u)


def two_lags(_rng: np.random.Generator, tau: float) -> Map:
    """Let two quick lags follow each other: nearly a delay of their sum."""
    return lambda _drive, u: lag(lag(u, tau / 2), tau / 2)


def sensor(_rng: np.random.Generator, tau: float) -> Map:
    """Let a sensor follow with a time constant."""
    return lambda _drive, y: lag(y, tau)


def averaging(_rng: np.random.Generator, tau: float) -> Map:
    """Average over twice the lag."""
    width = max(1, round(2 * tau * RATE))
    return lambda _drive, y: scipy.signal.lfilter(np.ones(width) / width, [1.0], y)


def mode(rng: np.random.Generator, strength: float) -> Map:
    """Let the output ring: ``strength`` is the period in seconds."""
    damping = float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))
    w = 2 * np.pi / strength

    def ring(_drive: Drive, y: Signal) -> Signal:
        system = scipy.signal.cont2discrete(([w * w], [1.0, 2 * damping * w, w * w]), 1 / RATE, method="foh")
        rung: Signal = scipy.signal.lfilter(np.ravel(system[0]), np.ravel(system[1]), y)
        return rung

    return ring


def clock(rng: np.random.Generator, strength: float) -> Map:
    """Let the clocks run apart."""
    e = sign(rng) * strength
    return lambda drive, u: np.interp(drive.time * (1.0 + e), drive.time, u)


def lag(signal: Signal, tau: float) -> Signal:
    """Follow a signal with a time constant."""
    a = np.exp(-1.0 / (RATE * tau))
    lagged: Signal = scipy.signal.lfilter([1.0 - a], [1.0, -a], signal)
    return lagged


def sensor_gain(rng: np.random.Generator, strength: float) -> Map:
    """Scale."""
    factor = 1.0 + sign(rng) * strength
    return lambda _drive, y: factor * y


def zero(rng: np.random.Generator, strength: float) -> Map:
    """Shift."""
    c = sign(rng) * strength * OUTPUT
    return lambda _drive, y: y + c


def drift(rng: np.random.Generator, strength: float) -> Map:
    """Drift over the record."""
    c = sign(rng) * strength * OUTPUT
    return lambda drive, y: y + c * drive.time / drive.time[-1]


def jump(rng: np.random.Generator, strength: float) -> Map:
    """Jump at an instant."""
    c, at = sign(rng) * strength * OUTPUT, float(rng.uniform(0.15, 0.6))
    return lambda drive, y: y + c * (drive.time > at * drive.time[-1])


def thermal(rng: np.random.Generator, strength: float) -> Map:
    """Follow the temperature."""
    c = sign(rng) * strength * OUTPUT
    return lambda drive, y: y + c * drive.temperature


def slow_thermal(rng: np.random.Generator, strength: float) -> Map:
    """Let the body follow the sensor's temperature within two seconds."""
    c = sign(rng) * strength * OUTPUT
    return lambda drive, y: y + c * lag(drive.temperature, 2.0)


def creep(rng: np.random.Generator, strength: float) -> Map:
    """Creep with a time constant between 1 and 15 s."""
    tau = float(np.exp(rng.uniform(0.0, np.log(15.0))))
    return lambda _drive, y: y + strength * lag(y, tau)


def log_creep(_rng: np.random.Generator, strength: float) -> Map:
    """Creep with the logarithm of time."""
    return lambda _drive, y: y + strength * sum(lag(y, tau) for tau in (0.3, 1.0, 3.0, 10.0, 30.0))


def play(_rng: np.random.Generator, strength: float) -> Map:
    """Follow with a play."""

    def follow(_drive: Drive, u: Signal) -> Signal:
        places, place = [], float(u[0])
        for wanted in u.tolist():
            place = min(max(place, wanted - strength), wanted + strength)
            places.append(place)
        return np.array(places)

    return follow


def stick(_rng: np.random.Generator, strength: float) -> Map:
    """Follow in slips."""

    def follow(_drive: Drive, u: Signal) -> Signal:
        places, place = [], float(u[0])
        for wanted in u.tolist():
            if abs(wanted - place) > strength:
                place = wanted
            places.append(place)
        return np.array(places)

    return follow


def cut_input(_rng: np.random.Generator, strength: float) -> Map:
    """Cut the voltage off."""
    return lambda _drive, u: np.clip(u, -PEAK * (1 - strength), PEAK * (1 - strength))


def cut_output(_rng: np.random.Generator, strength: float) -> Map:
    """Cut the displacement off."""

    def cut(_drive: Drive, y: Signal) -> Signal:
        level = float(np.max(np.abs(y))) * (1 - strength)
        return np.clip(y, -level, level)

    return cut


def dead(_rng: np.random.Generator, strength: float) -> Map:
    """Do nothing around zero."""
    return lambda _drive, u: np.where(np.abs(u) > strength, u - strength * np.sign(u), 0.0)


def kink(rng: np.random.Generator, strength: float) -> Map:
    """Bend at zero."""
    k = sign(rng) * strength
    return lambda _drive, y: np.where(y > 0.0, (1 + k) * y, (1 - k) * y)


def hum(rng: np.random.Generator, strength: float) -> Map:
    """Add a sine."""
    frequency, phase = float(rng.uniform(2.0, 45.0)), float(rng.uniform(0.0, 2 * np.pi))
    return lambda drive, y: y + strength * OUTPUT * np.sin(2 * np.pi * frequency * drive.time + phase)


def coupling(rng: np.random.Generator, strength: float) -> Map:
    """Add the neighbour's signal."""
    c = sign(rng) * strength * OUTPUT
    return lambda drive, y: y + c * drive.neighbour


def slew(_rng: np.random.Generator, strength: float) -> Map:
    """Follow at a limited rate, in V/s."""

    def follow(_drive: Drive, u: Signal) -> Signal:
        most, places, place = strength / RATE, [], float(u[0])
        for wanted in u.tolist():
            place += min(max(wanted - place, -most), most)
            places.append(place)
        return np.array(places)

    return follow


def ripple(rng: np.random.Generator, strength: float) -> Map:
    """Add a wave over the displacement itself."""
    period = float(rng.uniform(3.0, 8.0))
    return lambda _drive, y: y + strength * OUTPUT * np.sin(2 * np.pi * y / period)
