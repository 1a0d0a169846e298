"""Signal maps to inject at the input or at the output of a plant.

Each factory takes a random generator and a strength and returns a `Map`. Functions with a range return a
factory that also draws a value from this range.
"""

from collections.abc import Callable

import numpy as np
import scipy

from lab.diagnosis.injection.excitation import Excitation, Signal, random_sign
from lab.diagnosis.injection.plant import Map

Make = Callable[[np.random.Generator, float], Map]

#: Steps within a sample of a lag that depends on its error.
LAG_STEPS = 8


def delay(_rng: np.random.Generator, tau: float) -> Map:
    """Delay by tau seconds.

    The signal is a cubic between samples: a linear one is smoothed, as by a lag, and a spline overshoots at
    jumps.
    """
    return lambda drive, u: scipy.interpolate.PchipInterpolator(drive.time, u)(
        np.maximum(drive.time - tau, 0.0)
    )


def two_lags(_rng: np.random.Generator, tau: float) -> Map:
    """Two first-order lags in series, which approximate a delay of tau seconds."""
    return lambda drive, u: lag(lag(u, tau / 2, drive.rate), tau / 2, drive.rate)


def sensor_lag(_rng: np.random.Generator, tau: float) -> Map:
    """First-order lag with a time constant of tau seconds."""
    return lambda drive, y: lag(y, tau, drive.rate)


def moving_average(_rng: np.random.Generator, tau: float) -> Map:
    """Average over a moving window of 2 tau seconds."""

    def average(drive: Excitation, y: Signal) -> Signal:
        # From the integral of a spline, so that the window need not be a whole number of samples. Before the
        # first sample the signal is constant.
        integral = scipy.interpolate.CubicSpline(drive.time, y).antiderivative()
        window_start = drive.time - 2 * tau
        integral_start = integral(np.maximum(window_start, 0.0)) + np.minimum(window_start, 0.0) * y[0]
        return (integral(drive.time) - integral_start) / (2 * tau)

    return average


def resonance(rng: np.random.Generator, strength: float) -> Map:
    """Second-order resonance of the output; ``strength`` is the period in seconds."""
    damping = float(np.exp(rng.uniform(np.log(0.02), np.log(0.3))))
    w = 2 * np.pi / strength

    def resonate(drive: Excitation, y: Signal) -> Signal:
        mode = ([w * w], [1.0, 2 * damping * w, w * w])
        system = scipy.signal.cont2discrete(mode, 1 / drive.rate, method="foh")
        response: Signal = scipy.signal.lfilter(np.ravel(system[0]), np.ravel(system[1]), y - y[0])
        return y[0] + response

    return resonate


def clock_skew(rng: np.random.Generator, strength: float) -> Map:
    """Clocks of the input and the output that run at different rates."""
    e = random_sign(rng) * strength
    return lambda drive, u: np.interp(drive.time * (1.0 + e), drive.time, u)


def lag(signal: Signal, tau: float, rate: float) -> Signal:
    """Return a signal, linear between samples, after a first-order lag that starts in equilibrium.

    A signal that is held would come half a sample early, which is much of a short lag.
    """
    steps = 1.0 / (rate * tau)
    a = np.exp(-steps)
    mean = (1.0 - a) / steps
    lagged: Signal = scipy.signal.lfilter([1.0 - mean, mean - a], [1.0, -a], signal - signal[0])
    return signal[0] + lagged


def gain_error(rng: np.random.Generator, strength: float) -> Map:
    """Relative gain error of either sign."""
    factor = 1.0 + random_sign(rng) * strength
    return lambda _drive, y: factor * y


def offset(rng: np.random.Generator, strength: float) -> Map:
    """Constant offset."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.peak_output


def linear_drift(rng: np.random.Generator, strength: float) -> Map:
    """Linear drift over the record."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.peak_output * drive.time / drive.time[-1]


def jump(rng: np.random.Generator, strength: float) -> Map:
    """Jump at a random time."""
    c, at = random_sign(rng) * strength, float(rng.uniform(0.15, 0.6))
    return lambda drive, y: y + c * drive.peak_output * (drive.time > at * drive.time[-1])


def thermal_drift(rng: np.random.Generator, strength: float) -> Map:
    """Drift proportional to the temperature."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.peak_output * drive.temperature


def lagged_thermal_drift(rng: np.random.Generator, strength: float) -> Map:
    """Drift proportional to the temperature after a first-order lag of two seconds."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.peak_output * lag(drive.temperature, 2.0, drive.rate)


def exponential_creep(lower: float, upper: float) -> Make:
    """Exponential creep with a time constant from a range, in seconds."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        tau = float(np.exp(rng.uniform(np.log(lower), np.log(upper))))
        return lambda drive, y: y + strength * lag(y - y[0], tau, drive.rate)

    return make


def logarithmic_creep(_rng: np.random.Generator, strength: float) -> Map:
    """Creep with the logarithm of time, as a sum of exponential creep."""
    taus = (0.3, 1.0, 3.0, 10.0, 30.0)
    return lambda drive, y: y + strength * sum(lag(y - y[0], tau, drive.rate) for tau in taus)


def backlash(_rng: np.random.Generator, strength: float) -> Map:
    """Backlash (play operator) with a half-width of ``strength``."""

    def follow(_drive: Excitation, u: Signal) -> Signal:
        positions, position = [], float(u[0])
        for target in u.tolist():
            position = min(max(position, target - strength), target + strength)
            positions.append(position)
        return np.array(positions)

    return follow


def stiction(_rng: np.random.Generator, strength: float) -> Map:
    """Stick-slip: the output jumps to the input when their distance reaches ``strength``.

    It does so between two samples of the input, which is continuous.
    """

    def follow(_drive: Excitation, u: Signal) -> Signal:
        positions, position = [], float(u[0])
        for target in u.tolist():
            position += strength * int((target - position) / strength)
            positions.append(position)
        return np.array(positions)

    return follow


def quantise(_rng: np.random.Generator, strength: float) -> Map:
    """Actuator that moves to multiples of a step of ``strength``."""
    return lambda _drive, u: strength * np.floor(u / strength + 0.5)


def input_saturation(_rng: np.random.Generator, strength: float) -> Map:
    """Saturation of the input, at a fraction of its typical largest value."""
    return lambda drive, u: np.clip(u, -drive.peak_input * (1 - strength), drive.peak_input * (1 - strength))


def output_saturation(_rng: np.random.Generator, strength: float) -> Map:
    """Saturation of the output, at a fraction of its largest absolute value."""

    def saturate(_drive: Excitation, y: Signal) -> Signal:
        level = float(np.max(np.abs(y))) * (1 - strength)
        return np.clip(y, -level, level)

    return saturate


def dead_zone(_rng: np.random.Generator, strength: float) -> Map:
    """Dead zone around zero with a half-width of ``strength``."""
    return lambda _drive, u: np.where(np.abs(u) > strength, u - strength * np.sign(u), 0.0)


def sign_dependent_gain(rng: np.random.Generator, strength: float) -> Map:
    """Different gains for positive and negative values."""
    k = random_sign(rng) * strength
    return lambda _drive, y: np.where(y > 0.0, (1 + k) * y, (1 - k) * y)


def periodic_disturbance(lower: float, upper: float) -> Make:
    """Sinusoidal disturbance with a frequency from a range, in Hz."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        frequency, phase = float(rng.uniform(lower, upper)), float(rng.uniform(0.0, 2 * np.pi))
        return lambda drive, y: (
            y + strength * drive.peak_output * np.sin(2 * np.pi * frequency * drive.time + phase)
        )

    return make


def _draw_sweep(rng: np.random.Generator, lower: float, upper: float) -> Callable[[Excitation], Signal]:
    """Draw a sweep between two frequencies of a range in Hz, as a function of the excitation."""
    first, last, phase = rng.uniform(lower, upper), rng.uniform(lower, upper), rng.uniform(0.0, 2 * np.pi)

    def wave(drive: Excitation) -> Signal:
        cycles = first * drive.time + 0.5 * (last - first) * drive.time**2 / drive.time[-1]
        return np.asarray(np.sin(2 * np.pi * cycles + phase))

    return wave


def swept_disturbance(lower: float, upper: float) -> Make:
    """Sinusoidal disturbance of the input with a frequency that runs through a range, in Hz."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        wave = _draw_sweep(rng, lower, upper)
        return lambda drive, u: u + strength * drive.peak_input * wave(drive)

    return make


def swept_interference(lower: float, upper: float) -> Make:
    """Sinusoidal disturbance of the output with a frequency that runs through a range, in Hz."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        wave = _draw_sweep(rng, lower, upper)
        return lambda drive, y: y + strength * drive.peak_output * wave(drive)

    return make


def varying_delay(rng: np.random.Generator, strength: float) -> Map:
    """Delay that swings about its mean, which is the strength in seconds, one to five times in the record."""
    part, swings, phase = rng.uniform(0.5, 0.9), rng.uniform(1.0, 5.0), rng.uniform(0.0, 2 * np.pi)

    def follow(drive: Excitation, u: Signal) -> Signal:
        angle = 2 * np.pi * swings * drive.time / drive.time[-1] + phase
        return np.interp(drive.time - strength * (1.0 + part * np.sin(angle)), drive.time, u)

    return follow


def growing_lag(_rng: np.random.Generator, strength: float) -> Map:
    """Lag that grows with its error, fourfold at a tenth of the peak; the strength is the least constant."""

    def follow(drive: Excitation, y: Signal) -> Signal:
        # The middles of the steps of a signal that is linear between samples.
        middles = np.interp(np.arange(0.5, LAG_STEPS * y.size) / LAG_STEPS - 1.0, np.arange(y.size), y)
        shown, reading = [], float(y[0])
        for target in middles.tolist():
            error = target - reading
            lag = strength * (1.0 + 30.0 * abs(error) / drive.peak_output)
            reading += error * (1.0 - np.exp(-1.0 / (LAG_STEPS * drive.rate * lag)))
            shown.append(reading)
        return np.array(shown[LAG_STEPS - 1 :: LAG_STEPS])

    return follow


def sensor_hysteresis(rng: np.random.Generator, strength: float) -> Map:
    """Play of the sensor; the strength is its half width relative to the peak of the output."""
    return lambda drive, y: backlash(rng, strength * drive.peak_output)(drive, y)


def cross_coupling(rng: np.random.Generator, strength: float) -> Map:
    """Cross-coupling of the neighbouring channel."""
    c = random_sign(rng) * strength
    return lambda drive, y: y + c * drive.peak_output * drive.neighbour


def second_input(rng: np.random.Generator, strength: float) -> Map:
    """Second input: the neighbouring channel acts where the input does."""
    c = random_sign(rng) * strength
    return lambda drive, u: u + c * drive.peak_input * drive.neighbour


def temperature_gain(rng: np.random.Generator, strength: float) -> Map:
    """Gain that depends on the temperature."""
    c = random_sign(rng) * strength
    return lambda drive, u: u * (1.0 + c * drive.temperature)


def rate_limit(_rng: np.random.Generator, strength: float) -> Map:
    """Rate limiter; the strength is the RMS of the rate of the input relative to the limit."""

    def follow(_drive: Excitation, u: Signal) -> Signal:
        max_step = float(np.sqrt(np.mean(np.diff(u) ** 2))) / strength
        positions, position = [], float(u[0])
        for target in u.tolist():
            position += min(max(target - position, -max_step), max_step)
            positions.append(position)
        return np.array(positions)

    return follow


def uneven_lag(_rng: np.random.Generator, strength: float) -> Map:
    """First-order lag that is three times as slow upwards as downwards; the strength is the slow constant."""

    def follow(drive: Excitation, u: Signal) -> Signal:
        positions, position = [], float(u[0])
        up, down = (1.0 - np.exp(-factor / (strength * drive.rate)) for factor in (1.0, 3.0))
        for target in u.tolist():
            position += (up if target > position else down) * (target - position)
            positions.append(position)
        return np.array(positions)

    return follow


def cyclic_error(lower: float, upper: float) -> Make:
    """Sinusoidal error as a function of the output, with a period from a range, in units of the output."""

    def make(rng: np.random.Generator, strength: float) -> Map:
        period = float(rng.uniform(lower, upper))
        return lambda drive, y: y + strength * drive.peak_output * np.sin(2 * np.pi * y / period)

    return make


def power_law(rng: np.random.Generator, strength: float) -> Map:
    """Characteristic of a pump: a power of the signal, relative to its peak."""
    exponent = float(np.exp(random_sign(rng) * strength))
    return lambda drive, u: drive.peak_input * np.sign(u) * np.abs(u / drive.peak_input) ** exponent


def slow_modulation(rng: np.random.Generator, strength: float) -> Map:
    """Gain that oscillates slowly, one and a half to four periods over the record."""
    periods, phase = float(rng.uniform(1.5, 4.0)), float(rng.uniform(0.0, 2 * np.pi))

    def modulate(drive: Excitation, y: Signal) -> Signal:
        angle = 2 * np.pi * periods * drive.time / drive.time[-1] + phase
        return y * (1.0 + strength * np.sin(angle))

    return modulate
