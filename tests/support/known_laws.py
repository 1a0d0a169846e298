"""Laws with given parameters, simulated records of them, and the error of an output-error fit of the law."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

Signal = NDArray[np.float64]

#: Output of a law at sample k for its parameters, the outputs before, and the inputs (samples, inputs).
Step = Callable[[Signal, Signal, Signal, int], float]

#: Samples of the outputs before the first one that is compared.
WARM_UP = 20


@dataclass(frozen=True)
class WavySignal:
    """A sum of sines, whose values and means at any time are known.

    Attributes
    ----------
    sizes, rates, phases : ndarray, shape (sines,)
        Amplitudes, angular frequencies and phases.
    """

    sizes: Signal
    rates: Signal
    phases: Signal

    @classmethod
    def draw(cls, rng: np.random.Generator, dt: float) -> "WavySignal":
        """Draw a signal of ten sines with periods of 8 to 100 samples and an amplitude below one."""
        periods = np.exp(rng.uniform(np.log(8.0), np.log(100.0), 10)) * dt
        return cls(np.full(10, 0.2), 2.0 * np.pi / periods, rng.uniform(0.0, 2.0 * np.pi, 10))

    def values(self, times: Signal) -> Signal:
        return np.sin(np.outer(times, self.rates) + self.phases) @ self.sizes

    def means(self, times: Signal, dt: float) -> Signal:
        """Return the means from each time to the time ``dt`` later."""
        angles = np.outer(times, self.rates) + self.phases
        return (np.cos(angles) - np.cos(angles + dt * self.rates)) @ (self.sizes / self.rates) / dt


@dataclass(frozen=True)
class KnownLaw:
    """A law of motion in discrete time.

    Attributes
    ----------
    step : callable
    parameters : tuple of float
    noise : float
        Standard deviation of the noise of the measured output.
    drives : tuple of str
        Shape of each input: ``levels``, ``switch``, ``balanced`` or ``waves``.
    lag : int
        Oldest sample that the law reads.
    start : float
        Output before the record.
    """

    step: Step
    parameters: tuple[float, ...]
    noise: float = 0.02
    drives: tuple[str, ...] = ("levels",)
    lag: int = 1
    start: float = 0.0

    def simulate(self, parameters: Signal, u: Signal, first: Signal) -> Signal:
        """Return the output without noise; ``first`` are its first samples."""
        y = np.zeros(len(u))
        y[: self.lag] = first[: self.lag]
        for k in range(self.lag, len(u)):
            y[k] = self.step(parameters, y, u, k)
        return y


@dataclass(frozen=True)
class Measurement:
    """Samples of a system.

    Attributes
    ----------
    dt : float
        Sampling time in seconds.
    u : ndarray, shape (samples, inputs)
        Inputs; of waves, the means from each sample to the next.
    clean, y : ndarray, shape (samples,)
        Output without and with noise.
    waves : tuple of WavySignal
        Inputs that are waves, as functions of the time.
    """

    dt: float
    u: Signal
    clean: Signal
    y: Signal
    waves: tuple[WavySignal, ...]

    @property
    def t(self) -> Signal:
        """Times in seconds."""
        return self.dt * np.arange(len(self.y))


def measure(law: KnownLaw, dt: float, samples: int, seed: int) -> Measurement:
    """Simulate a law under inputs of a seed, and measure its output with noise."""
    rng = np.random.default_rng(seed)
    u, waves = np.empty((samples, len(law.drives))), []
    for place, drive in enumerate(law.drives):
        if drive == "waves":
            waves.append(WavySignal.draw(rng, dt))
            u[:, place] = waves[-1].means(dt * np.arange(samples), dt)
        else:
            held = rng.integers(3, 12, samples)
            levels = rng.uniform(-1.0, 1.0, samples)
            if drive == "switch":
                levels = np.arange(samples) % 2.0
                held *= 4
            elif drive == "balanced":
                # Each level is followed by its opposite, so that an integral stays in its range.
                held *= 3
                levels[1::2], held[1::2] = -levels[:-1:2], held[:-1:2]
            u[:, place] = np.repeat(levels, held)[:samples]
    u[: law.lag] = 0.0  # at rest
    clean = law.simulate(np.array(law.parameters), u, np.full(law.lag, law.start))
    return Measurement(dt, u, clean, clean + law.noise * rng.standard_normal(samples), tuple(waves))


def fit_output_error(law: KnownLaw, record: Measurement) -> Signal:
    """Return the parameters of a law that minimise the error of its free run on a record."""

    def find_residual(values: Signal) -> Signal:
        return law.simulate(values[law.lag :], record.u, values[: law.lag]) - record.y

    start = np.concatenate((record.y[: law.lag], law.parameters))
    return np.asarray(least_squares(find_residual, start, x_scale="jac", max_nfev=30).x[law.lag :])


def find_least_error(law: KnownLaw, record: Measurement, test: Measurement) -> float:
    """Return the RMSE on a test record of the free run of a law that was fitted to a record."""
    found = law.simulate(fit_output_error(law, record), test.u, test.clean)
    return float(np.sqrt(np.mean((found - test.y)[WARM_UP:] ** 2)))


def _battery(p: Signal, y: Signal, u: Signal, k: int) -> float:
    past = (1.0 + p[0]) * y[k - 1] - p[0] * y[k - 2]
    return float(past + p[1] * u[k, 0] + p[2] * u[k - 1, 0] + p[3] * u[k - 2, 0])


#: A linear open-circuit voltage, a resistance, and a resistance parallel to a capacitance, at 1 s.
_POLE, _R0, _R1, _SLOPE = 0.9672, 0.05, 0.03, 2e-4
_BATTERY = (
    _POLE,
    -_R0,
    -_SLOPE + _R0 * (1.0 + _POLE) - _R1 * (1.0 - _POLE),
    _SLOPE * _POLE - _R0 * _POLE + _R1 * (1.0 - _POLE),
)

LAWS: Mapping[str, KnownLaw] = MappingProxyType(
    {
        "first order": KnownLaw(lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 1, 0], (0.9, 0.2)),
        "second order": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] * y[k - 2] + p[2] * u[k - 1, 0],
            (1.5, -0.7, 0.2),
            lag=2,
        ),
        "dead time": KnownLaw(lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 7, 0], (0.85, 0.3), lag=7),
        "temperature": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] + p[2] * u[k - 1, 0], (0.95, 1.1, 0.8), 0.05, start=22.0
        ),
        "thermostat": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] + p[2] * u[k - 1, 0],
            (0.96, 0.84, 1.2),
            0.05,
            ("switch",),
            start=21.0,
        ),
        "square": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 1, 0] + p[2] * u[k - 1, 0] ** 2,
            (0.8, 0.3, 0.2),
        ),
        "bilinear": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 1, 0] + p[2] * u[k - 1, 0] * y[k - 1],
            (0.8, 0.3, 0.12),
        ),
        "cubic": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 1, 0] + p[2] * y[k - 1] ** 3,
            (0.95, 0.35, -0.05),
        ),
        "two inputs": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 1, 0] + p[2] * u[k - 1, 1],
            (0.85, 0.3, -0.2),
            drives=("levels", "levels"),
        ),
        "waves": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 1, 0], (0.9, 0.2), 0.01, ("waves",)
        ),
        "static map": KnownLaw(
            lambda p, _y, u, k: p[0] * u[k, 0] ** 2 + p[1] * u[k, 0] * u[k, 1],
            (2.0, 0.5),
            drives=("levels", "levels"),
        ),
        "battery": KnownLaw(_battery, _BATTERY, 0.0005, ("balanced",), lag=2, start=3.7),
        "tank": KnownLaw(
            lambda p, y, u, k: p[0] * y[k - 1] + p[1] * u[k - 1, 0],
            (1.0, 0.02),
            0.01,
            ("balanced",),
            start=1.0,
        ),
    }
)
