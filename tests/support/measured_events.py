"""Records with gross errors of the output, and with physical events that are none."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Signal = NDArray[np.float64]
Random = np.random.Generator

SAMPLES = 2000
K = np.arange(SAMPLES)


def _lag(u: Signal, pole: float, gain: float = 1.0) -> Signal:
    return lfilter([0.0, gain * (1.0 - pole)], [1.0, -pole], u)


def _ring(u: Signal, period: float, damping: float) -> Signal:
    radius, angle = np.exp(-damping), 2.0 * np.pi / period
    a1, a2 = -2.0 * radius * np.cos(angle), radius**2
    return lfilter([0.0, 1.0 + a1 + a2], [1.0, a1, a2], u)


def _steps(rng: Random, hold: int) -> Signal:
    return np.repeat(rng.uniform(-1.0, 1.0, SAMPLES // hold + 1), hold)[:SAMPLES]


def _noisy(y: Signal, rng: Random, level: float) -> Signal:
    return y + level * np.std(y) * rng.normal(size=y.size)


def _make_lag(rng: Random) -> tuple[Signal, Signal]:
    u = _steps(rng, 25)
    return u, _noisy(_lag(u, 0.92), rng, 0.01)


def _make_oscillator(rng: Random) -> tuple[Signal, Signal]:
    u = _steps(rng, 40)
    return u, _noisy(_ring(u, 18.0, 0.06), rng, 0.02)


def _make_sine(rng: Random) -> tuple[Signal, Signal]:
    u = np.sin(2.0 * np.pi * K / rng.uniform(60.0, 150.0))
    return u, _noisy(_lag(u, 0.8) + 0.2 * u**3, rng, 0.005)


def _make_multisine(rng: Random) -> tuple[Signal, Signal]:
    u = sum(np.sin(2.0 * np.pi * f * K / SAMPLES + rng.uniform(0.0, 6.3)) for f in range(3, 90, 4))
    return u, _noisy(_ring(u, 30.0, 0.2), rng, 0.03)


def _make_chirp(rng: Random) -> tuple[Signal, Signal]:
    u = np.sin(2.0 * np.pi * (0.002 * K + 0.5 * 0.04 * K**2 / SAMPLES))
    return u, _noisy(_lag(u, 0.85), rng, 0.01)


def _make_hysteresis(rng: Random) -> tuple[Signal, Signal]:
    u = np.sin(2.0 * np.pi * K / 200.0) * (1.0 + 0.4 * np.sin(2.0 * np.pi * K / rng.uniform(900, 1500)))
    y = np.zeros(SAMPLES)
    for k in range(1, SAMPLES):
        y[k] = min(max(y[k - 1], u[k] - 0.3), u[k] + 0.3)
    return u, _noisy(y, rng, 0.003)


def _make_thermal(rng: Random) -> tuple[Signal, Signal]:
    u = (rng.random(SAMPLES // 60 + 1) < 0.5).astype(float).repeat(60)[:SAMPLES]
    return u, _noisy(20.0 + 30.0 * _lag(u, 0.99) + 5.0 * _lag(u, 0.9), rng, 0.01)


def _make_binary(rng: Random) -> tuple[Signal, Signal]:
    u = np.sign(rng.normal(size=SAMPLES // 5)).repeat(5)
    return u, _noisy(_lag(_lag(u, 0.7), 0.8), rng, 0.02)


def _make_tank(rng: Random) -> tuple[Signal, Signal]:
    u, y = _steps(rng, 80) + 1.2, np.ones(SAMPLES)
    for k in range(1, SAMPLES):
        y[k] = max(y[k - 1] + 0.05 * (u[k - 1] - np.sqrt(y[k - 1])), 0.0)
    return u, _noisy(y, rng, 0.005)


def _make_drift(rng: Random) -> tuple[Signal, Signal]:
    u = lfilter([1.0], [1.0, -0.9], rng.normal(size=SAMPLES))
    return u, _lag(u, 0.7) + np.cumsum(0.05 * rng.normal(size=SAMPLES))


#: Records without any event, as input and output.
SIGNALS: Mapping[str, Callable[[Random], tuple[Signal, Signal]]] = {
    "first-order lag": _make_lag,
    "oscillator": _make_oscillator,
    "sine through a nonlinearity": _make_sine,
    "multisine": _make_multisine,
    "chirp": _make_chirp,
    "play": _make_hysteresis,
    "thermal": _make_thermal,
    "binary excitation": _make_binary,
    "tank": _make_tank,
    "drifting disturbance": _make_drift,
}


def add_samples(y: Signal, rng: Random) -> tuple[Signal, list[int]]:
    """Add single samples of half to twice the range."""
    places = np.sort(rng.choice(np.arange(20, SAMPLES - 20, 12), rng.integers(1, 7), replace=False))
    wrong = y.copy()
    wrong[places] += rng.choice([-1.0, 1.0], places.size) * rng.uniform(0.5, 2.0, places.size) * np.ptp(y)
    return wrong, places.tolist()


def add_dropouts(y: Signal, rng: Random) -> tuple[Signal, list[int]]:
    """Replace single samples by a value below the range, as when a contact opens."""
    places = np.sort(rng.choice(np.arange(20, SAMPLES - 20, 12), rng.integers(1, 7), replace=False))
    wrong = y.copy()
    wrong[places] = y.min() - 0.5 * np.ptp(y)
    return wrong, places.tolist()


def add_bursts(y: Signal, rng: Random) -> tuple[Signal, list[int]]:
    """Replace runs of two to four samples by values about the range."""
    firsts = np.sort(rng.choice(np.arange(20, SAMPLES - 20, 20), rng.integers(1, 4), replace=False))
    places = [int(first) + k for first in firsts for k in range(rng.integers(2, 5))]
    wrong = y.copy()
    signs = rng.choice([-1.0, 1.0], len(places))
    wrong[places] = y.mean() + signs * rng.uniform(1.0, 3.0, len(places)) * np.ptp(y)
    return wrong, places


#: Gross errors that are added to an output; each returns it and the samples.
ERRORS: Mapping[str, Callable[[Signal, Random], tuple[Signal, list[int]]]] = {
    "single samples": add_samples,
    "dropouts": add_dropouts,
    "short bursts": add_bursts,
}


def _choose(rng: Random, count: int) -> NDArray[np.int64]:
    return np.sort(rng.choice(np.arange(50, SAMPLES - 80, 40), count, replace=False))


def _make_floods(rng: Random) -> tuple[Signal, Signal]:
    rain = np.where(rng.random(SAMPLES) < 0.25, rng.gamma(0.5, 12.0, SAMPLES), 0.0)
    wet, fast, y = 20.0, 0.0, np.zeros(SAMPLES)
    for k in range(SAMPLES):
        wet = 0.95 * wet + rain[k]
        fast = rng.uniform(0.15, 0.5) * fast + rain[k] * max(wet - 60.0, 0.0) / 50.0
        y[k] = (1.0 + 0.03 * wet + 3.0 * fast) * np.exp(0.04 * rng.normal())
    return rain, y


def _make_impacts(rng: Random) -> tuple[Signal, Signal]:
    u = np.sin(2.0 * np.pi * K / 160.0)
    hits = np.zeros(SAMPLES)
    hits[_choose(rng, 5)] = rng.uniform(5.0, 20.0, 5)
    return u, _noisy(_lag(u, 0.8) + 3.0 * _ring(hits, 6.0, 0.25), rng, 0.005)


def _make_ringing(rng: Random) -> tuple[Signal, Signal]:
    pulses = np.zeros(SAMPLES)
    pulses[_choose(rng, 6)] = 1.0
    return pulses, _noisy(_ring(pulses, 12.0, 0.1), rng, 0.01)


def _make_relay(rng: Random) -> tuple[Signal, Signal]:
    u, y, on = 2.0 + np.sin(2.0 * np.pi * K / 300.0), np.zeros(SAMPLES), 0.0
    for k in range(1, SAMPLES):
        on = 1.0 if y[k - 1] < u[k] - 0.2 else 0.0 if y[k - 1] > u[k] + 0.2 else on
        y[k] = y[k - 1] + 0.3 * (5.0 * on - y[k - 1])
    return u, y + 0.01 * rng.normal(size=SAMPLES)


def _make_stick_slip(rng: Random) -> tuple[Signal, Signal]:
    u, y = 0.01 * K + 0.3 * np.sin(2.0 * np.pi * K / 400.0), np.zeros(SAMPLES)
    for k in range(1, SAMPLES):
        y[k] = u[k] if abs(u[k] - y[k - 1]) > rng.uniform(0.6, 1.0) else y[k - 1]
    return u, y + 0.005 * rng.normal(size=SAMPLES)


def _make_load_steps(rng: Random) -> tuple[Signal, Signal]:
    u = np.sin(2.0 * np.pi * K / 220.0)
    load = np.zeros(SAMPLES)
    for first in _choose(rng, 4):
        load[first:] += rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 6.0)
    return u, u + load + 0.01 * rng.normal(size=SAMPLES)


def _make_inrush(rng: Random) -> tuple[Signal, Signal]:
    on = (rng.random(SAMPLES // 50) < 0.5).astype(float).repeat(50)
    starts = np.maximum(np.diff(on, prepend=0.0), 0.0)
    return on, 100.0 * on + 900.0 * starts + 2.0 * rng.normal(size=SAMPLES) + 20.0


def _make_power_peaks(rng: Random) -> tuple[Signal, Signal]:
    u = np.sin(2.0 * np.pi * K / 500.0)
    peaks = np.zeros(SAMPLES)
    peaks[_choose(rng, 15)] = 10.0 * rng.pareto(1.5, 15) + 3.0
    return u, 5.0 + u + lfilter([1.0], [1.0, -0.4], peaks) + 0.05 * rng.normal(size=SAMPLES)


def _make_starts(rng: Random) -> tuple[Signal, Signal]:
    u = np.zeros(SAMPLES)
    u[rng.integers(300, 900) :] = 1.0
    return u, _noisy(_lag(u, 0.6) + 4.0 * lfilter([1.0, -1.0], [1.0, -0.3], u), rng, 0.005)


def _make_valve_pulses(rng: Random) -> tuple[Signal, Signal]:
    u = np.zeros(SAMPLES)
    for first in _choose(rng, 8):
        u[first : first + rng.integers(1, 4)] = rng.uniform(0.3, 1.0)
    return u, 2.0 * u**2 + 0.01 * rng.normal(size=SAMPLES)


#: Records with physical events, as input and output.
EVENTS: Mapping[str, Callable[[Random], tuple[Signal, Signal]]] = {
    "floods": _make_floods,
    "impacts that ring": _make_impacts,
    "pulses answered by ringing": _make_ringing,
    "relay": _make_relay,
    "stick and slip": _make_stick_slip,
    "steps of the load": _make_load_steps,
    "inrush of a motor": _make_inrush,
    "power peaks": _make_power_peaks,
    "single start with overshoot": _make_starts,
    "valve pulses": _make_valve_pulses,
}
