"""Disturbances: a second input, coupling of another channel, a periodic disturbance."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from islands.effects.channels import CHANNEL_NOTE, channel, channel_range, channel_unit, has_channel
from islands.effects.interface.context import (
    LINE_WIDTH,
    Parameter,
    Points,
    Signal,
    SimulationContext,
    compute_spectrum,
    find_single_frequency,
)
from islands.effects.interface.effect import Effect, Formula, MapEquation, Site

#: Error of the frequency of a line in the spectrum, relative to the resolution.
LINE_ERROR = 0.1


def _add_channel(signal: Signal, values: Signal, context: SimulationContext) -> Signal:
    return signal + values[0] * channel(context, False)


def _second_input_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    unit = f"{context.input_unit}/{channel_unit(context, False)}"
    return (Parameter("k", unit, 0.0, 0.01 * context.input_peak / channel_range(context, False)),)


def _second_input_starting_points(context: SimulationContext, _residual: Signal) -> Points:
    size = context.input_peak / channel_range(context, False)
    return ((0.02 * size,), (0.5 * size,))


SECOND_INPUT = Effect(
    name="second-input",
    title="second input",
    summary="A second input acts where the first one does: u + k w, where w is a given channel",
    family="disturbance",
    site=Site.INPUT,
    parameters=_second_input_parameters,
    starting_points=_second_input_starting_points,
    form=_add_channel,
    equation=lambda _: MapEquation("x + n0*z0", (("coupled",),)),
    formula=Formula("x + k*w", names=("w",), note=CHANNEL_NOTE),
    source="Ljung, System Identification, 2nd ed., section 4.2",
    is_applicable=lambda context: has_channel(context, False),
    similar_to="cross-coupling",
    distinguished_by="the response to the channel has the dynamics of that to the input",
    occurs_in="a second actuator, a feedforward or a load that the simulation does not read",
)


CROSS_COUPLING = Effect(
    name="cross-coupling",
    title="coupling of a channel into the output",
    summary="Another signal couples into the output: y + k w, where w is a given channel",
    family="disturbance",
    site=Site.OUTPUT,
    parameters=lambda context: (
        Parameter(
            "k",
            f"{context.output_unit}/{channel_unit(context, False)}",
            0.0,
            0.01 * context.output_peak / channel_range(context, False),
        ),
    ),
    starting_points=lambda context, _: ((0.02 * context.output_peak / channel_range(context, False),),),
    form=_add_channel,
    equation=lambda _: MapEquation("x + n0*z0", (("coupled",),)),
    formula=Formula("x + k*w", names=("w",), note=CHANNEL_NOTE),
    source="Ljung, System Identification, 2nd ed., section 13",
    is_applicable=lambda context: has_channel(context, False),
    similar_to="thermal-drift, second-input",
    distinguished_by="a residual that follows a channel that is not a temperature",
    occurs_in="cables without shield, a second axis, a common supply",
)


def _periodic_disturbance_form(y: Signal, values: Signal, context: SimulationContext) -> Signal:
    cosine, sine = _make_waves(float(values[2]), context.start_time, context.dt, y.size)
    return y + values[0] * cosine + values[1] * sine


@lru_cache(maxsize=4)
def _make_waves(frequency: float, start: float, dt: float, samples: int) -> tuple[Signal, Signal]:
    """Return the cosine and the sine of a frequency over time; most derivatives have it in common."""
    angle = 2 * np.pi * frequency * (start + dt * np.arange(samples, dtype=np.float64))
    return np.cos(angle), np.sin(angle)


def _find_input_harmonics(
    frequencies: NDArray[np.floating[Any]], context: SimulationContext
) -> NDArray[np.bool_]:
    """Return which frequencies are multiples of that of an input with a single line in its spectrum.

    A disturbance there cannot be distinguished from a distortion of the response.
    """
    line = find_single_frequency(context)
    if line is None:
        return np.zeros(frequencies.size, dtype=np.bool_)
    order = np.round(frequencies / line)
    distance = np.abs(frequencies - order * line)
    return (order >= 1) & (distance < (LINE_WIDTH + LINE_ERROR * order) / context.fit_end_time)


def _periodic_disturbance_starting_points(context: SimulationContext, residual: Signal) -> Points:
    fitted = int(context.fit_end_time / context.dt)
    spectrum = compute_spectrum(residual[:fitted])
    frequencies = np.fft.rfftfreq(4 * fitted, context.dt)
    spectrum[frequencies < 2.0 / context.fit_end_time] = 0.0
    spectrum[_find_input_harmonics(frequencies, context)] = 0.0
    if not spectrum.any():
        return ()
    strongest = float(frequencies[np.argmax(spectrum)])
    angle = 2 * np.pi * strongest * context.time[:fitted]
    waves = np.column_stack([np.cos(angle), np.sin(angle)])
    cosine, sine = np.linalg.lstsq(waves, residual[:fitted], rcond=None)[0]
    return ((float(cosine), float(sine), strongest),)


PERIODIC_DISTURBANCE = Effect(
    name="periodic-disturbance",
    title="sinusoidal disturbance",
    summary="Sinusoidal disturbance of unknown frequency, added to the output",
    family="disturbance",
    site=Site.OUTPUT,
    parameters=lambda context: (
        Parameter("cosine", context.output_unit, 0.0, 0.005 * context.output_peak),
        Parameter("sine", context.output_unit, 0.0, 0.005 * context.output_peak),
        Parameter(
            "frequency", "Hz", 0.0, 0.1 / context.fit_end_time, 2.0 / context.fit_end_time, 0.499 / context.dt
        ),
    ),
    starting_points=_periodic_disturbance_starting_points,
    form=_periodic_disturbance_form,
    equation=lambda _: MapEquation(f"x + n0*cos({2 * np.pi}*n2*t) + n1*sin({2 * np.pi}*n2*t)"),
    formula=Formula("x + a*cos(2*pi*f*t) + b*sin(2*pi*f*t)", symbols=("a", "b", "f")),
    source="Stoica and Moses, Spectral Analysis of Signals, section 4",
    linear_parameters=2,
    extra_degrees_of_freedom=2,
    depends_on_time=True,
    similar_to="resonance",
    distinguished_by="a line in the spectrum that is no multiple of the frequency of the input",
    occurs_in="mains hum, fans, pumps, unbalance of a neighbouring machine",
)
