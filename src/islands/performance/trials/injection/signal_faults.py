"""Maps of a signal, as they may be hidden: what acts before a system on its input, or behind it.

Each takes chance and a strength, and gives what is done to a signal. What is made with a range first draws
from that as well.
"""

from collections.abc import Callable

import numpy as np
import scipy

from islands.performance.trials.injection.excitation import Excitation, Signal, random_sign
from islands.performance.trials.injection.plant import Map

Make = Callable[[np.random.Generator, float], Map]


def later(_rng: np.random.Generator, tau: float) -> Map:
    """Delay."""
    return lambda drive, u: np.interp(drive.time - tau, drive.time, u)


def two_lags(_rng: np.random.Generator, tau: float) -> Map:
    """Let two quick lags follow each other: nearly a delay of their sum."""
    return lambda drive, u: lag(lag(u, tau / 2, drive.rate), tau / 2, drive.rate)


def sensor(_rng: np.random.Generator, tau: float) -> Map:
    """Let a sensor follow with a time constant."""
    return lambda drive, y: lag(y, tau, drive.rate)


def averaging(_rng: np.random.Generator, tau: float) -> Map:
    """Average over twice the lag."""

    def average(drive: Excitation, y: Signal) -> Signal:
        # Of a spline's integral, so that no width has to be a whole number of samples; it began at rest.
        integral = scipy.interpolate.CubicSpline(drive.time, y).antiderivative()
        ago = drive.time - 2 * tau
        before = integral(np.maximum(ago, 0.0)) + np.minimum(ago, 0.0) * y[0]
        return (integral(drive.time) - before) / (2 * tau)

    return average


def mode(rng: np.random.Generator, strength: float) -> Map:
    """Let the output ring: ``strength`` is the period in seconds."""
    damping = float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))
    w = 2 * np.pi / strength

    def ring(drive: Excitation, y: Signal) -> Signal:
        mode = ([w * w], [1.0, 2 * damping * w, w * w])
        system = scipy.signal.cont2discrete(mode, 1 / drive.rate, method="foh")
        rung: Signal = scipy.signal.lfilter(np.ravel(system[0]), np.ravel(system[1]), y - y[0])
        return y[0] + rung

    return ring


def clock(rng: np.random.Generator, strength: float) -> Map:
    """Let the clocks run apart."""
    e = random_sign(rng) * strength
    return lambda drive, u: np.interp(drive.time * (1.0 + e), drive.time, u)


def lag(signal: Signal, tau: float, rate: float) -> Signal:
    """Follow a signal with a time constant, from rest with it."""
    a = np.exp(-1.0 / (rate * tau))
    lagged: Signal = scipy.signal.lfilter([1.0 - a], [1.0, -a], signal - signal[0])
    return signal[0] + lagged


def sensor_gain(rng: np.random.Generator, strength: float) -> Map:
    """Scale."""
    factor = 1.0 + random_sign(rng) * strength
    return lambda _drive, y: factor * y


def zero(rng: np.random.Generator, strength: float) -> Map:
    """Shift."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.output


def drift(rng: np.random.Generator, strength: float) -> Map:
    """Drift over the record."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.output * drive.time / drive.time[-1]


def jump(rng: np.random.Generator, strength: float) -> Map:
    """Jump at an instant."""
    c, at = random_sign(rng) * strength, float(rng.uniform(0.15, 0.6))
    return lambda drive, y: y + c * drive.output * (drive.time > at * drive.time[-1])


def thermal(rng: np.random.Generator, strength: float) -> Map:
    """Follow the temperature."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.output * drive.temperature


def slow_thermal(rng: np.random.Generator, strength: float) -> Map:
    """Let the body follow the sensor's temperature within two seconds."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.output * lag(drive.temperature, 2.0, drive.rate)


def creep(least: float, most: float) -> Make:
    """Creep with a time constant in a range."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        tau = float(np.exp(rng.uniform(np.log(least), np.log(most))))
        return lambda drive, y: y + strength * lag(y - y[0], tau, drive.rate)

    return make


def log_creep(_rng: np.random.Generator, strength: float) -> Map:
    """Creep with the logarithm of time."""
    taus = (0.3, 1.0, 3.0, 10.0, 30.0)
    return lambda drive, y: y + strength * sum(lag(y - y[0], tau, drive.rate) for tau in taus)


def play(_rng: np.random.Generator, strength: float) -> Map:
    """Follow with a play."""

    def follow(_drive: Excitation, u: Signal) -> Signal:
        places, place = [], float(u[0])
        for wanted in u.tolist():
            place = min(max(place, wanted - strength), wanted + strength)
            places.append(place)
        return np.array(places)

    return follow


def stick(_rng: np.random.Generator, strength: float) -> Map:
    """Follow in slips."""

    def follow(_drive: Excitation, u: Signal) -> Signal:
        places, place = [], float(u[0])
        for wanted in u.tolist():
            if abs(wanted - place) > strength:
                place = wanted
            places.append(place)
        return np.array(places)

    return follow


def cut_input(_rng: np.random.Generator, strength: float) -> Map:
    """Cut the input off."""
    return lambda drive, u: np.clip(u, -drive.peak * (1 - strength), drive.peak * (1 - strength))


def cut_output(_rng: np.random.Generator, strength: float) -> Map:
    """Cut the output off."""

    def cut(_drive: Excitation, y: Signal) -> Signal:
        level = float(np.max(np.abs(y))) * (1 - strength)
        return np.clip(y, -level, level)

    return cut


def dead(_rng: np.random.Generator, strength: float) -> Map:
    """Do nothing around zero."""
    return lambda _drive, u: np.where(np.abs(u) > strength, u - strength * np.sign(u), 0.0)


def kink(rng: np.random.Generator, strength: float) -> Map:
    """Bend at zero."""
    k = random_sign(rng) * strength
    return lambda _drive, y: np.where(y > 0.0, (1 + k) * y, (1 - k) * y)


def hum(least: float, most: float) -> Make:
    """Add a sine of a frequency in a range."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        frequency, phase = float(rng.uniform(least, most)), float(rng.uniform(0.0, 2 * np.pi))
        return lambda drive, y: (
            y + strength * drive.output * np.sin(2 * np.pi * frequency * drive.time + phase)
        )

    return make


def coupling(rng: np.random.Generator, strength: float) -> Map:
    """Add the neighbour's signal."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.output * drive.neighbour


def slew(_rng: np.random.Generator, strength: float) -> Map:
    """Follow at a limited rate, in the input's unit a second."""

    def follow(drive: Excitation, u: Signal) -> Signal:
        most, places, place = strength / drive.rate, [], float(u[0])
        for wanted in u.tolist():
            place += min(max(wanted - place, -most), most)
            places.append(place)
        return np.array(places)

    return follow


def ripple(least: float, most: float) -> Make:
    """Add a wave over the output itself, of a period in a range."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        period = float(rng.uniform(least, most))
        return lambda drive, y: y + strength * drive.output * np.sin(2 * np.pi * y / period)

    return make
