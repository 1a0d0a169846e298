"""Clean records: the simulation is right, and the noise or the excitation is unusual."""

from collections.abc import Callable

import numpy as np
import scipy

from lab.diagnosis.injection.excitation import Signal
from lab.diagnosis.injection.noise import NOISES
from lab.diagnosis.injection.unusual.cause import DrawResponse, Response, UnusualCause
from lab.diagnosis.injection.unusual.integration import (
    MACHINE_DT,
    PROCESS_DT,
    PROCESS_SAMPLES,
)
from lab.diagnosis.injection.unusual.machine_causes import respond_cleanly, respond_exactly
from lab.diagnosis.injection.unusual.process_causes import (
    GAIN,
    TIME,
    respond_first_order,
    respond_second_order,
)

#: Range of the standard deviation of the noise, relative to that of the output.
_NOISE = (0.005, 0.02)

#: Samples that are discarded until a filter has reached its stationary state.
_WARM_UP = 1000

Rng = np.random.Generator
DrawNoise = Callable[[Rng, Rng, Signal], Signal]


def _with_noise(draw_clean: Callable[[Rng], Response], draw_noise: DrawNoise) -> DrawResponse:
    """Return the draw of a record with noise, which is given the generators and the output."""

    def draw(plant: Rng, record: Rng) -> Response:
        size, clean = plant.uniform(*_NOISE), draw_clean(record)
        noise = draw_noise(plant, record, clean.y)
        return Response(clean.u, clean.y, size * np.std(clean.y) * noise / np.std(noise))

    return draw


def _in_band(plant: Rng, record: Rng, y: Signal) -> Signal:
    """Draw noise with a resonance in the band of the machine, near its own."""
    radius, frequency = plant.uniform(0.9, 0.98), plant.uniform(4.0, 12.0)
    angle = 2 * np.pi * frequency * MACHINE_DT
    poles = np.poly(radius * np.exp([1j * angle, -1j * angle])).real
    white = record.standard_normal(y.size + _WARM_UP)
    return scipy.signal.lfilter([1.0, plant.uniform(-0.5, 0.5), 0.2], poles, white)[_WARM_UP:]


def _heteroscedastic(plant: Rng, record: Rng, y: Signal) -> Signal:
    """Draw autoregressive noise that grows with the size of the output."""
    pole = plant.uniform(0.6, 0.95)
    noise = scipy.signal.lfilter([1.0], [1.0, -pole], record.standard_normal(y.size + _WARM_UP))[_WARM_UP:]
    return noise * np.hypot(0.3, y / np.std(y))


def _pink(_plant: Rng, record: Rng, y: Signal) -> Signal:
    return NOISES["pink"](record, y)


def _noise_free(draw_clean: Callable[[Rng], Response]) -> DrawResponse:
    def draw(_plant: Rng, record: Rng) -> Response:
        clean = draw_clean(record)
        return Response(clean.u, clean.y, np.zeros_like(clean.y))

    return draw


def _closed_loop(plant: Rng, record: Rng) -> Response:
    """Control a process by the reading of the same sample, so that its noise is in the input at once."""
    gain, integral, sigma = plant.uniform(0.8, 1.6), plant.uniform(0.01, 0.03), plant.uniform(0.01, 0.03)
    lengths = record.integers(40, 110, PROCESS_SAMPLES // 40 + 1)
    targets = np.repeat(record.normal(0.0, 1.5, lengths.size), lengths)[:PROCESS_SAMPLES]
    noise = sigma * record.standard_normal(PROCESS_SAMPLES)
    pole, x, total = float(np.exp(-PROCESS_DT / TIME)), 0.0, 0.0
    inputs, outputs = [], []
    for target, error in zip(targets.tolist(), noise.tolist(), strict=True):
        deviation = target - x - error
        total += integral * deviation
        inputs.append(gain * deviation + total)
        outputs.append(x)
        x = pole * x + (1.0 - pole) * GAIN * inputs[-1]
    return Response(np.array(inputs)[:, None], np.array(outputs), noise)


def _clean(name: str, summary: str, simulation: str, draw: DrawResponse) -> UnusualCause:
    return UnusualCause(name, summary, simulation, draw, is_clean=True)


#: Clean records by the kind of their noise.
CLEAN_RECORDS = (
    _clean(
        "clean-in-band",
        "ARMA noise with a resonance near that of the machine",
        "second-order",
        _with_noise(respond_cleanly, _in_band),
    ),
    _clean(
        "clean-heteroscedastic",
        "autoregressive noise that grows with the output",
        "linear:2",
        _with_noise(respond_second_order, _heteroscedastic),
    ),
    _clean("clean-pink", "pink noise of a machine", "second-order", _with_noise(respond_cleanly, _pink)),
    _clean(
        "clean-steps",
        "1/f noise, with steps of the input",
        "linear:1",
        _with_noise(respond_first_order, _pink),
    ),
    _clean(
        "clean-noise-free-machine",
        "no noise, and a force that is linear between samples",
        "second-order",
        _noise_free(respond_exactly),
    ),
    _clean("clean-noise-free-process", "no noise", "linear:1", _noise_free(respond_first_order)),
    _clean("clean-loop", "closed loop without a delay", "linear:1", _closed_loop),
)
