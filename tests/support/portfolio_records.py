"""Simulated records of systems of many kinds, for the choice among presets.

A kind has a response to its inputs, a shape of the inputs, and measurement noise. Record and test record have
different inputs and noise.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from islands.effects.interface.context import SimulationContext
from islands.kernels.memory_operators import play_from
from islands.records.dataset import Dataset
from support.built_in_simulators import make_piezo

Signal = NDArray[np.float64]

#: Sampling time in seconds.
DT = 0.01

#: Integration steps in one sampling time.
_STEPS = 10

#: Samples before the first one of a record: transients of the initial state.
_RUN_IN = 100


@dataclass(frozen=True)
class Kind:
    """A kind of system and of experiment.

    Attributes
    ----------
    respond : callable
        ``respond(u)`` returns the output for inputs (samples, inputs), without noise.
    drive : str
        Shape of the inputs: an entry of ``DRIVES``.
    low, high : float
        Range of the inputs.
    noise : float
        Standard deviation of the measurement noise as a fraction of that of the output.
    samples, inputs : int
    """

    respond: Callable[[Signal], Signal]
    drive: str = "steps"
    low: float = -1.0
    high: float = 1.0
    noise: float = 0.005
    samples: int = 2000
    inputs: int = 1

    def record(self, seed: int) -> tuple[Dataset, Dataset]:
        """Return a record and a test record of half its length, at least 500 samples."""
        generator = np.random.default_rng(seed)
        return self._measure(self.samples, generator), self._measure(max(500, self.samples // 2), generator)

    def _measure(self, samples: int, generator: np.random.Generator) -> Dataset:
        count = samples + _RUN_IN
        shapes = [DRIVES[self.drive](count, generator) for _ in range(self.inputs)]
        u = self.low + (self.high - self.low) * 0.5 * (np.column_stack(shapes) + 1.0)
        y = np.asarray(self.respond(u), dtype=float)[_RUN_IN:]
        y = y + self.noise * y.std() * generator.standard_normal(samples)
        names = ("u",) if self.inputs == 1 else tuple(f"u{i + 1}" for i in range(self.inputs))
        return Dataset(u[_RUN_IN:], y, DT, names)


def _steps(count: int, generator: np.random.Generator, hold: int = 10) -> Signal:
    return np.repeat(generator.uniform(-1.0, 1.0, -(-count // hold)), hold)[:count]


def _slow_steps(count: int, generator: np.random.Generator) -> Signal:
    return _steps(count, generator, 40)


def _white(count: int, generator: np.random.Generator) -> Signal:
    return generator.uniform(-1.0, 1.0, count)


def _smooth(count: int, generator: np.random.Generator, window: int = 41) -> Signal:
    noise = np.convolve(generator.standard_normal(count + window - 1), np.hanning(window), "valid")
    return np.clip(noise / (2.5 * noise.std()), -1.0, 1.0)


def _slow(count: int, generator: np.random.Generator) -> Signal:
    return _smooth(count, generator, 161)


def _sines(count: int, generator: np.random.Generator) -> Signal:
    k = np.arange(count)
    phases, sizes = generator.uniform(0.0, 2.0 * np.pi, 3), (0.55, 0.3, 0.15)
    waves = zip(sizes, (400.0, 171.0, 93.0), phases, strict=True)
    return np.sum([size * np.sin(2.0 * np.pi * k / length + phase) for size, length, phase in waves], axis=0)


def _ramps(count: int, generator: np.random.Generator) -> Signal:
    """Return ramps of 40 samples between random levels, each held for 20 samples."""
    levels = np.repeat(generator.uniform(-1.0, 1.0, count // 60 + 2), 2)
    times = np.cumsum(np.tile([40.0, 20.0], levels.size // 2))
    return np.interp(np.arange(count), times, levels)


DRIVES: Mapping[str, Callable[[int, np.random.Generator], Signal]] = MappingProxyType(
    {
        "steps": _steps,
        "slow steps": _slow_steps,
        "white": _white,
        "smooth": _smooth,
        "slow": _slow,
        "sines": _sines,
        "ramps": _ramps,
    }
)


def _linear(numerator: list[float], denominator: list[float], delay: int = 1) -> Callable[[Signal], Signal]:
    return lambda u: lfilter([0.0] * delay + numerator, denominator, u[:, 0])


def _integrate(
    derivative: Callable[[Signal, Signal], list[float]], states: int, start: float = 0.0
) -> Callable[[Signal], Signal]:
    """Return the first state of ``x' = derivative(x, u)`` by Euler steps; the input is held."""

    def respond(u: Signal) -> Signal:
        x, y = np.full(states, start), np.empty(len(u))
        for k, now in enumerate(u):
            y[k] = x[0]
            for _ in range(_STEPS):
                x = x + DT / _STEPS * np.array(derivative(x, now))
        return y

    return respond


def _iterate(step: Callable[[float, float, Signal], float]) -> Callable[[Signal], Signal]:
    """Return the solution of ``y(k) = step(y(k-1), y(k-2), u(k-1))``."""

    def respond(u: Signal) -> Signal:
        y = np.zeros(len(u))
        for k in range(2, len(u)):
            y[k] = step(y[k - 1], y[k - 2], u[k - 1])
        return y

    return respond


def _bouc_wen(u: Signal, leak: float = 0.0, asymmetry: float = 0.0) -> Signal:
    x = np.ascontiguousarray(u[:, 0])
    context = SimulationContext(x, DT, {}, {}, 1.0, 1.0, "V", "um", x.size * DT)
    effects = {"relaxation": leak, "loop-asymmetry": asymmetry}
    h = x - make_piezo().simulate(np.array([1.0, 1.5, 0.7, 1.0]), x, context, effects, ())
    return x - 0.6 * h


def _several_plays(u: Signal) -> Signal:
    widths, weights = (0.1, 0.25, 0.5), (0.4, 0.3, 0.2)
    return sum(
        weight * play_from(np.ascontiguousarray(u[:, 0]), width)
        for width, weight in zip(widths, weights, strict=True)
    )


def _saturating_loop(u: Signal) -> Signal:
    return np.tanh(1.2 * _bouc_wen(u)) + 0.1 * u[:, 0] ** 2


def _through_lag(u: Signal) -> Signal:
    return lfilter([0.3], [1.0, -0.7], _bouc_wen(u))


def _stiction(x: Signal, u: Signal) -> list[float]:
    # Viscous friction, and a Coulomb friction that grows towards standstill; a steep curve replaces the jump.
    v = x[0]
    return [8.0 * (2.0 * u[0] - 0.4 * v - (0.25 + 0.15 * np.exp(-((v / 0.1) ** 2))) * np.tanh(v / 0.02))]


def _sliding(x: Signal, u: Signal) -> list[float]:
    return [x[1], 60.0 * u[0] - 60.0 * x[0] - 4.0 * x[1] - 8.0 * np.tanh(x[1] / 0.05)]


def _dead_zone(u: Signal) -> Signal:
    return lfilter([0.0, 0.2], [1.0, -0.8], np.sign(u[:, 0]) * np.maximum(np.abs(u[:, 0]) - 0.3, 0.0))


def _delayed_cube(u: Signal) -> Signal:
    return lfilter([0.0] * 7 + [0.2], [1.0, -0.8], u[:, 0] + 0.8 * u[:, 0] ** 3)


def _hammerstein(u: Signal) -> Signal:
    return lfilter([0.0, 0.1, 0.05], [1.0, -1.5, 0.6], u[:, 0] + 0.7 * u[:, 0] ** 2)


def _wiener(u: Signal) -> Signal:
    return np.tanh(1.5 * lfilter([0.0, 0.1, 0.05], [1.0, -1.5, 0.6], u[:, 0]))


def _heat(x: Signal, u: Signal) -> list[float]:
    return [2.0 * (x[1] - x[0]), 3.0 * (30.0 * u[0] - (x[1] - 20.0))]


def _two_tanks(x: Signal, u: Signal) -> list[float]:
    upper = np.sqrt(max(x[1], 0.0))
    return [4.0 * (upper - np.sqrt(max(x[0], 0.0))), 4.0 * (u[0] - upper)]


def _duffing(x: Signal, u: Signal) -> list[float]:
    return [x[1], 80.0 * u[0] - 3.0 * x[1] - 60.0 * x[0] - 60.0 * x[0] ** 3]


def _pendulum(x: Signal, u: Signal) -> list[float]:
    return [x[1], 60.0 * u[0] - 4.0 * x[1] - 60.0 * np.sin(x[0])]


_LAG, _RESONANCE = [1.0, -0.9], [1.0, -1.6, 0.8]

KINDS: Mapping[str, Kind] = MappingProxyType(
    {
        "Bouc-Wen": Kind(_bouc_wen, "sines"),
        "Bouc-Wen, noisy": Kind(_bouc_wen, "slow", noise=0.02, samples=6000),
        "asymmetric loop": Kind(lambda u: _bouc_wen(u, asymmetry=0.5), "smooth", noise=0.0),
        "saturating loop": Kind(_saturating_loop, "ramps"),
        "backlash": Kind(lambda u: play_from(np.ascontiguousarray(u[:, 0]), 0.2), "sines"),
        "several plays": Kind(_several_plays, "ramps"),
        "loop and lag": Kind(_through_lag, "slow"),
        "first order": Kind(_linear([0.1], _LAG)),
        "first order, clean": Kind(_linear([0.1], _LAG), noise=0.0),
        "first order, noisy": Kind(_linear([0.1], _LAG), noise=0.1),
        "resonance": Kind(_linear([0.1, 0.1], _RESONANCE), "white"),
        "resonance, short": Kind(_linear([0.1, 0.1], _RESONANCE), noise=0.02, samples=300),
        "oversampled": Kind(
            _integrate(lambda x, u: [0.5 * (u[0] - x[0])], 1), "slow steps", noise=0.03, samples=8000
        ),
        "thermal with offset": Kind(_integrate(_heat, 2, 20.0), "slow steps", 0.0, 1.0),
        "dead time": Kind(_linear([0.2], [1.0, -0.8], 8)),
        "dead time, noisy": Kind(_linear([0.1], _LAG, 20), "slow steps", noise=0.05),
        "dead time, resonance": Kind(_linear([0.1, 0.1], _RESONANCE, 12), "white"),
        "dead time, cubic": Kind(_delayed_cube),
        "Coulomb friction": Kind(
            _iterate(lambda y, _, u: 0.95 * y + 0.3 * u[0] - 0.06 * np.sign(y)), noise=0.002
        ),
        "stiction": Kind(_integrate(_stiction, 1), "smooth"),
        "sliding mass": Kind(_integrate(_sliding, 2), "steps"),
        "quadratic drag": Kind(_iterate(lambda y, _, u: 0.98 * y + 0.3 * u[0] - 0.1 * y * abs(y))),
        "tank": Kind(
            _iterate(lambda y, _, u: max(y + 0.1 * u[0] - 0.1 * np.sqrt(max(y, 0.0)), 0.0)), "steps", 0.3, 1.6
        ),
        "two tanks": Kind(_integrate(_two_tanks, 2, 1.0), "slow steps", 0.3, 1.6),
        "Wiener": Kind(_wiener),
        "Hammerstein": Kind(_hammerstein),
        "dead zone": Kind(_dead_zone, "smooth"),
        "bilinear": Kind(_iterate(lambda y, z, u: 0.9 * y - 0.1 * z + 0.3 * u[0] - 0.2 * y * u[0])),
        "Duffing": Kind(_integrate(_duffing, 2)),
        "pendulum": Kind(_integrate(_pendulum, 2)),
        "two inputs": Kind(
            _iterate(lambda y, _, u: 0.8 * y + 0.3 * u[0] - 0.2 * u[0] * u[1] + 0.1 * u[1]), inputs=2
        ),
    }
)
