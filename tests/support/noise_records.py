"""Records whose residual looks like noise: errors that are none, clean noise, and a loop within a sample."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from islands.records.dataset import Dataset
from support.simulated_records import recorded

SAMPLES = 2000
DT = 0.1

#: Standard deviation of the noise of the sensor, in V.
SENSOR = 0.0124


def respond(u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the output of a linear plant of second order that responds one sample late."""
    return np.asarray(lfilter([0.0, 0.06, 0.04], [1.0, -1.5, 0.6], u))


def draw_input(rng: np.random.Generator) -> NDArray[np.float64]:
    """Return a slow random input, in V."""
    return np.asarray(lfilter([1.0], [1.0, -0.92], rng.standard_normal(SAMPLES)))


def make_quantised_actuator(seed: int) -> Dataset:
    """Return a record of the plant behind an actuator that rounds its input to steps of 0.6 V."""
    rng = np.random.default_rng(seed)
    u = draw_input(rng)
    y = respond(0.6 * np.round(u / 0.6)) + SENSOR * rng.standard_normal(SAMPLES)
    return recorded(u, y, DT, ("V", "V"))


def make_swept_force(seed: int) -> Dataset:
    """Return a record of the plant with an unmeasured input whose frequency rises."""
    rng = np.random.default_rng(seed)
    time = DT * np.arange(SAMPLES)
    u, rise = draw_input(rng), rng.uniform(0.001, 0.002)
    unmeasured = 0.9 * np.sin(2 * np.pi * (0.03 * time + 0.5 * rise * time**2))
    return recorded(u, respond(u + unmeasured) + SENSOR * rng.standard_normal(SAMPLES), DT, ("V", "V"))


def make_day_wave(seed: int) -> Dataset:
    """Return a temperature under a heater, on which the ambient temperature acts with a period of a day."""
    rng = np.random.default_rng(seed)
    samples, dt = 2400, 60.0
    u = np.repeat(rng.uniform(0.0, 10.0, samples // 60), 60)
    day = 0.78 * np.sin(2 * np.pi * dt * np.arange(samples) / 86400.0 + rng.uniform(0.0, 6.28))
    y = 20.0 + np.asarray(lfilter([0.0, 0.06], [1.0, -0.97], u)) + day + 0.1 * rng.standard_normal(samples)
    return recorded(u, y, dt, ("V", "K"))


def make_noisy_record(noise: str, seed: int) -> Dataset:
    """Return a record with clean noise: ``white``, ``slow``, ``in band``, ``pink`` or ``steps``."""
    rng = np.random.default_rng(seed)
    u, white = draw_input(rng), rng.standard_normal(SAMPLES)
    y = respond(u)
    if noise == "slow":
        white = np.asarray(lfilter([1.0], [1.0, -0.9], white))
    elif noise == "in band":
        white = np.asarray(lfilter([1.0], [1.0, -1.8, 0.9], white)) + 0.5 * rng.standard_normal(SAMPLES)
    elif noise in ("pink", "steps"):
        frequencies = np.fft.rfftfreq(SAMPLES)
        frequencies[0] = frequencies[1]
        white = np.fft.irfft(np.fft.rfft(white) / np.sqrt(frequencies), SAMPLES)
        white = white / white.std()
        if noise == "steps":
            white = white + np.repeat(0.7 * rng.standard_normal(SAMPLES // 200), 200)
    return recorded(u, y + 0.05 * y.std() * white / white.std(), DT, ("V", "V"))


def make_loop(seed: int, direct: float = 0.0) -> Dataset:
    """Return a record of a first-order plant whose controller computes u(k) from y(k).

    Parameters
    ----------
    direct : float
        Response of the plant at once.
    """
    rng = np.random.default_rng(seed)
    setpoint = np.repeat(rng.normal(5.0, 1.5, SAMPLES // 75 + 1), 75)[:SAMPLES]
    x, integral, gain = 5.0, 5.0, 1.5
    u, y = np.empty(SAMPLES), np.empty(SAMPLES)
    for k in range(SAMPLES):
        noise = 0.05 * rng.normal()
        integral += 0.02 * (setpoint[k] - x - noise)
        u[k] = (gain * (setpoint[k] - x - noise) + integral) / (1.0 + gain * direct)
        y[k] = x + direct * u[k] + noise
        x = 0.95 * x + 0.05 * u[k]
    return recorded(u, y, DT, ("V", "V"))
