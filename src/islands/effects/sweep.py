"""Disturbances whose frequency changes at a constant rate, at the input and at the output."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache, partial

import numpy as np

from islands.effects.interface.context import LINE_WIDTH, Parameter, Points, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Formula, MapEquation, Site

#: Largest length of the first windows, in samples.
WINDOW = 512

#: Largest step of the rates that are tried, in cycles per window, and in cycles per window between the first
#: window and the last. A line is then at most half of that away.
STEP, LINE_STEP = 2.0, 4.0

#: Least frequency in cycles per signal.
MIN_CYCLES = 2

#: Fraction of the largest power of a response below which a sweep is not visible.
MIN_RESPONSE = 1e-3

#: Least power of the spectrum of an input, relative to its largest one, from which a response is computed.
MIN_POWER = 1e-8

#: Least change of the frequency within the estimation part, relative to the resolution. A smaller one is a
#: steady line.
MIN_CHANGE = 2 * LINE_WIDTH

#: Fraction of the power of the input in one steady or swept line, from which the distortion of the response
#: to it is such a line as well.
MAX_LINE_POWER = 0.5


@dataclass(frozen=True, slots=True)
class SweptLine:
    """A line: frequency at the first sample in cycles per sample, its rate, and its power."""

    frequency: float
    rate: float
    power: float


def compute_response(u: Signal, y: Signal) -> Signal:
    """Return the frequency response from one signal to another, for spectra of twice their length."""
    window, size = np.hanning(u.size), 2 * u.size
    before, after = (np.fft.rfft((each - each.mean()) * window, size) for each in (u, y))
    smoothing = np.hanning(9)[1:-1]
    power = np.convolve(np.abs(before) ** 2, smoothing, mode="same")
    product = np.convolve(after * before.conj(), smoothing, mode="same")
    is_excited = power > MIN_POWER * power.max()
    return np.asarray(np.where(is_excited, product / np.where(is_excited, power, 1.0), 0.0))


def respond(signal: Signal, response: Signal) -> Signal:
    """Return a signal behind a frequency response."""
    spectrum = np.fft.rfft(signal, 2 * signal.size) * response
    return np.asarray(np.fft.irfft(spectrum, 2 * signal.size)[: signal.size])


def find_sweep(signal: Signal, response: Signal | None, min_change: float) -> SweptLine | None:
    """Return the sweep that explains most of a signal; None if there is none.

    Parameters
    ----------
    signal : ndarray, shape (samples,)
        Signal without a mean.
    response : ndarray or None
        Frequency response (`compute_response`) that is between the sweep and the signal; None for none.
    min_change : float
        Least change of the frequency, in cycles per signal.
    """
    if response is None:
        energy = np.ones(signal.size + 1)
    else:  # A matched filter.
        signal, energy = respond(signal, response.conj()), np.asarray(np.abs(response) ** 2)
    count = 1
    while signal.size > count * WINDOW:
        count *= 2
    least, line = min_change / count**2, None
    length = signal.size // count
    step = min(STEP, LINE_STEP / count)
    most = int(length / (2 * count) / step)
    sweeps = step * np.arange(-most, most + 1)
    while True:
        sweeps = sweeps[np.abs(sweeps) >= least]
        line = _find_line(signal, energy, count, sweeps)
        if line is None or count == 1:
            return line
        count //= 2
        least *= 4.0
        length = signal.size // count
        sweeps = line.rate * length**2 + min(STEP, LINE_STEP / count) * np.arange(-2, 3)


def measure_line(signal: Signal) -> float:
    """Return the fraction of the power of a signal that is one line, steady or swept."""
    found, total = find_sweep(signal, None, 0.0), float(signal @ signal)
    return found.power / total if found is not None and total > 0.0 else 0.0


def _find_line(signal: Signal, energy: Signal, count: int, sweeps: Iterable[float]) -> SweptLine | None:
    """Return the best line among sweeps in cycles per window, summed over a number of windows."""
    length = signal.size // count
    windows = signal[: count * length].reshape(count, length)
    size, time = 2 * length, np.arange(length) / length
    sums = np.concatenate([[0.0], np.cumsum(energy)])
    width = (energy.size - 1) / length  # of a frequency of a window, in those of the energy
    lowest, start = 2 * MIN_CYCLES / count, np.arange(length)
    best: SweptLine | None = None
    for sweep in sweeps:
        spectra = np.abs(np.fft.fft(windows * np.exp(-1j * np.pi * sweep * time**2), size)) ** 2
        end = start + 2 * sweep * count
        usable = start[(np.minimum(start, end) >= lowest) & (np.maximum(start, end) < length)]
        if not usable.size:
            continue
        line = np.zeros(usable.size)
        for index, spectrum in enumerate(spectra):
            line += spectrum[usable + round(2 * sweep * index)]
        first, last = (
            np.round(width * edge(usable, usable + 2 * sweep * count)).astype(np.intp)
            for edge in (np.minimum, np.maximum)
        )
        mean = (sums[last + 1] - sums[first]) / (last + 1 - first)
        is_visible = mean > MIN_RESPONSE * energy.max()
        power = np.where(is_visible, line / np.where(is_visible, mean, 1.0), 0.0)
        place = int(np.argmax(power))
        # A line of amplitude a has the power a^2/2 in each sample, and a length/2 in the spectrum.
        if power[place] > 0.0 and (best is None or 2.0 * power[place] / length > best.power):
            best = SweptLine(usable[place] / size, sweep / length**2, float(2.0 * power[place] / length))
    return best


def _form(signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    cosine, sine = _make_waves(
        float(values[2]), float(values[3]), context.start_time, context.dt, signal.size
    )
    return signal + values[0] * cosine + values[1] * sine


@lru_cache(maxsize=8)
def _make_waves(
    frequency: float, rate: float, start: float, dt: float, samples: int
) -> tuple[Signal, Signal]:
    """Return the cosine and the sine of a sweep over time; most derivatives have it in common."""
    time = start + dt * np.arange(samples, dtype=np.float64)
    angle = 2 * np.pi * (frequency + 0.5 * rate * time) * time
    return np.cos(angle), np.sin(angle)


def _list_parameters(context: SimulationContext, unit: str, peak: float) -> tuple[Parameter, ...]:
    duration, fastest = context.fit_end_time, 0.499 / context.dt
    return (
        Parameter("cosine", unit, 0.0, 0.005 * peak),
        Parameter("sine", unit, 0.0, 0.005 * peak),
        Parameter("frequency", "Hz", 0.0, 0.1 / duration, 0.0, fastest),
        Parameter("rate", "Hz/s", 0.0, 0.1 / duration**2, -fastest / duration, fastest / duration),
    )


def _output_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return _list_parameters(context, context.output_unit, context.output_peak)


def _starting_points(context: SimulationContext, residual: Signal, site: Site) -> Points:
    fitted = round(context.fit_end_time / context.dt)
    residual = residual[:fitted] - residual[:fitted].mean()
    size = float(np.max(np.abs(residual)))  # Squares of very large or small numbers are not finite, or zero.
    if not size > 0.0:
        return ()
    response, unit = None, size
    if site == Site.INPUT:
        assert context.measured is not None
        unit = context.input_peak or 1.0
        simulated = context.measured[:fitted] - residual
        response = compute_response(context.u[:fitted] / unit, simulated / size)
        if not response.any():
            return ()
    residual = residual / size
    points = []
    # The response spreads a weak sweep over time, so that it may be more distinct without it.
    responses = [None] if response is None else [response, None]
    for line in dict.fromkeys(find_sweep(residual, spread, MIN_CHANGE) for spread in responses):
        if line is not None:
            cosine, sine = _fit_amplitudes(line, residual, response)
            frequency, rate = line.frequency / context.dt, line.rate / context.dt**2
            points.append((cosine * unit, sine * unit, frequency, rate))
    return tuple(points)


def _fit_amplitudes(sweep: SweptLine, residual: Signal, response: Signal | None) -> tuple[float, float]:
    """Return the amplitudes of the cosine and the sine of a sweep that explain most of the residual."""
    waves: Iterable[Signal] = _make_waves(sweep.frequency, sweep.rate, 0.0, 1.0, residual.size)
    if response is not None:
        waves = [respond(wave, response) for wave in waves]
    cosine, sine = np.linalg.lstsq(np.column_stack(list(waves)), residual, rcond=None)[0]
    return float(cosine), float(sine)


def _has_many_lines(context: SimulationContext) -> bool:
    """Return whether the input is not a single line, whose distortions would look like another one."""
    fitted = round(context.fit_end_time / context.dt)
    u = context.u[:fitted] - context.u[:fitted].mean()
    return context.measured is not None and measure_line(u / (context.input_peak or 1.0)) < MAX_LINE_POWER


_EQUATION = f"x + n0*cos({2 * np.pi}*(n2 + 0.5*n3*t)*t) + n1*sin({2 * np.pi}*(n2 + 0.5*n3*t)*t)"

SWEPT_DISTURBANCE = Effect(
    name="swept-disturbance",
    title="disturbance that sweeps, at the input",
    summary="Disturbance that acts where the input does, with a frequency that changes at a constant rate",
    family="disturbance",
    site=Site.INPUT,
    parameters=lambda context: _list_parameters(context, context.input_unit, context.input_peak),
    starting_points=partial(_starting_points, site=Site.INPUT),
    form=_form,
    equation=lambda _: MapEquation(_EQUATION),
    formula=Formula(
        "x + a*cos(2*pi*(f + r*t/2)*t) + b*sin(2*pi*(f + r*t/2)*t)", symbols=("a", "b", "f", "r")
    ),
    source="Djuric and Kay, Parameter estimation of chirp signals, 1990",
    is_applicable=_has_many_lines,
    linear_parameters=2,
    extra_degrees_of_freedom=4,
    is_tuned=True,
    depends_on_time=True,
    similar_to="swept-interference, resonance, coloured noise",
    distinguished_by="a line that moves, with the amplitude and the phase of the response at its frequency",
    occurs_in="force or torque of a neighbouring machine that runs up or down, through a common frame",
)

SWEPT_INTERFERENCE = replace(
    SWEPT_DISTURBANCE,
    name="swept-interference",
    title="interference that sweeps, at the output",
    summary="Disturbance that is added to the output, with a frequency that changes at a constant rate",
    site=Site.OUTPUT,
    parameters=_output_parameters,
    starting_points=partial(_starting_points, site=Site.OUTPUT),
    similar_to="swept-disturbance, periodic-disturbance, coloured noise",
    distinguished_by="a line that moves and has the same amplitude at all frequencies",
    occurs_in="cables near the inverter of a drive that runs up or down, vibration of a sensor mount",
)
