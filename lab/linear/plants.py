"""Random stable plants with dead times, their experiments and their noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Signal = NDArray[np.float64]

EXCITATIONS = ("prbs", "steps", "multisine", "closed loop")
NOISES = ("white", "coloured", "process")


@dataclass(frozen=True, slots=True, eq=False)
class Plant:
    """Parallel sections that all inputs share.

    Attributes
    ----------
    sections : tuple of ndarray
        Denominators after the leading 1.
    numerators : ndarray, shape (inputs, sections, 2)
        Coefficients of the first two lags; the second is zero of a section of first order.
    delays : ndarray of int64, shape (inputs,)
    """

    sections: tuple[Signal, ...]
    numerators: Signal
    delays: NDArray[np.int64]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles in discrete time."""
        return np.concatenate([np.roots([1.0, *section]) for section in self.sections]).astype(np.complex128)

    @property
    def gains(self) -> Signal:
        """Static gain of every input."""
        sums = np.array([1.0 + section.sum() for section in self.sections])
        return np.asarray((self.numerators.sum(axis=2) / sums).sum(axis=1))

    def respond(self, u: Signal) -> Signal:
        """Return the output for inputs of shape (samples, inputs), from rest."""
        y = np.zeros(len(u))
        for place, delay in enumerate(self.delays):
            for section, numerator in zip(self.sections, self.numerators[place], strict=True):
                y += lfilter(np.r_[np.zeros(delay + 1), numerator], np.r_[1.0, section], u[:, place])
        return y


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """A noisy record of a plant, and another one from rest without noise."""

    plant: Plant
    excitation: str
    noise: str
    u: Signal
    y: Signal
    fresh_u: Signal
    fresh_y: Signal


def draw_plant(random: np.random.Generator) -> Plant:
    """Draw a plant of order 1 to 8 with 1 to 3 inputs."""
    order, inputs = int(random.integers(1, 9)), int(random.integers(1, 4))
    sections: list[Signal] = []
    while (left := order - sum(each.size for each in sections)) > 0:
        if left >= 2 and random.random() < 0.6:
            frequency = np.exp(random.uniform(np.log(0.03), np.log(2.5)))
            damping = np.exp(random.uniform(np.log(0.005), np.log(0.7)))
            pole = np.exp(frequency * (-damping + 1j * np.sqrt(1.0 - damping**2)))
            sections.append(np.array([-2.0 * pole.real, abs(pole) ** 2]))
        else:
            sections.append(np.array([-np.exp(-1.0 / np.exp(random.uniform(np.log(1.5), np.log(80.0))))]))
    numerators = np.zeros((inputs, len(sections), 2))
    for place, section in enumerate(sections):
        numerators[:, place, : section.size] = random.standard_normal((inputs, section.size))
        # Every section has a comparable part in the response to white noise.
        for row in range(inputs):
            response = lfilter(numerators[row, place], np.r_[1.0, section], np.eye(1, 4000)[0])
            numerators[row, place] *= np.exp(random.normal(0.0, 0.5)) / np.linalg.norm(response)
    return Plant(tuple(sections), numerators, random.integers(0, 41, inputs))


def excite(random: np.random.Generator, kind: str, samples: int) -> Signal:
    """Return one input; a closed loop has a set point of random steps."""
    if kind == "multisine":
        lines = np.arange(1, samples // 2 - 1)
        spectrum = np.zeros(samples // 2 + 1, complex)
        spectrum[lines] = np.exp(2j * np.pi * random.random(lines.size)) / np.sqrt(lines) ** random.choice(
            [0.0, 1.0]
        )
        u = np.fft.irfft(spectrum, samples)
        return np.asarray(u / u.std())
    hold = {"prbs": (1, 12), "steps": (10, 80), "closed loop": (1, 30)}[kind]
    u = np.zeros(0)
    while u.size < samples:
        level = random.choice([-1.0, 1.0]) if kind == "prbs" else random.uniform(-1.7, 1.7)
        u = np.append(u, np.full(int(random.integers(*hold)), level))
    return u[:samples]


def make_trial(seed: int) -> Trial:
    """Draw a plant and make its records; excitation and noise follow each other with the seeds."""
    random = np.random.default_rng(seed)
    plant = draw_plant(random)
    inputs, samples = len(plant.delays), int(random.integers(1000, 4001))
    excitation, noise = EXCITATIONS[seed % 4], NOISES[seed // 4 % 3]
    u = np.column_stack([excite(random, excitation, samples) for _ in range(inputs)])
    fresh = np.column_stack(
        [excite(random, "steps" if place % 2 else "prbs", 2000) for place in range(inputs)]
    )
    fresh[:60] = 0.0
    clean = plant.respond(u)
    level = random.uniform(0.02, 0.15) * clean.std()
    disturbance = random.standard_normal(samples)
    if noise == "coloured":
        pole = random.uniform(0.5, 0.95) * np.exp(1j * random.uniform(0.0, 2.0))
        disturbance = lfilter([1.0], [1.0, -2.0 * pole.real, abs(pole) ** 2], disturbance)
    if noise == "process":
        driven = np.zeros((samples, inputs))
        driven[:, 0] = disturbance
        disturbance = plant.respond(driven) + 0.1 * plant.respond(driven).std() * random.standard_normal(
            samples
        )
    disturbance *= level / disturbance.std()
    if excitation == "closed loop":
        u, y = _close_loop(plant, u, disturbance)
    else:
        y = clean + disturbance
    return Trial(plant, excitation, noise, u, y, fresh, plant.respond(fresh))


def _close_loop(plant: Plant, setpoint: Signal, disturbance: Signal) -> tuple[Signal, Signal]:
    """Feed the output back to the first input with half of the gain that the small-gain theorem allows."""
    z = np.exp(-1j * np.linspace(0.0, np.pi, 20001))
    response = sum(
        (n[0] * z + n[1] * z**2) / np.polyval(np.r_[1.0, s][::-1], z)
        for s, n in zip(plant.sections, plant.numerators[0], strict=True)
    )
    gain = 0.5 / np.abs(response).max()
    u, y = setpoint.copy(), np.zeros(len(setpoint))
    states = [np.zeros((len(plant.delays), 2)) for _ in plant.sections]
    for k in range(len(u)):
        y[k] = disturbance[k] + sum(float(state[:, 0].sum()) for state in states)
        u[k, 0] -= gain * y[k]
        for place, (section, state) in enumerate(zip(plant.sections, states, strict=True)):
            for row, delay in enumerate(plant.delays):
                late = u[k - delay, row] if k >= delay else 0.0
                first = state[row, 0]
                state[row, 0] = state[row, 1] - section[0] * first + plant.numerators[row, place, 0] * late
                last = section[1] if section.size == 2 else 0.0
                state[row, 1] = -last * first + plant.numerators[row, place, 1] * late
    return u, y
