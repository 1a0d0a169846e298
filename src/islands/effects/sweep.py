"""Disturbances whose frequency changes at a constant rate, at the input and at the output."""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np

from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import Effect, Signal, SimulationContext, Site
from islands.effects.interface.formula import Formula
from islands.effects.interface.input_spectrum import LINE_WIDTH
from islands.effects.interface.map_equation import MapEquation
from islands.effects.sweep_search import SweptLine, compute_response, find_sweep, measure_line, respond

#: Least change of the frequency within the estimation part, relative to the resolution. A smaller one is a
#: steady line.
MIN_CHANGE = 2 * LINE_WIDTH

#: Fraction of the power of the input in one steady or swept line, from which the distortion of the response
#: to it is such a line as well.
MAX_LINE_POWER = 0.5


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


def _input_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return _list_parameters(context, context.input_unit, context.input_peak)


def _output_parameters(context: SimulationContext) -> tuple[Parameter, ...]:
    return _list_parameters(context, context.output_unit, context.output_peak)


def _starting_points(
    context: SimulationContext, residual: Signal, site: Site
) -> tuple[tuple[float, ...], ...]:
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
    for found in dict.fromkeys(find_sweep(residual, each, MIN_CHANGE) for each in responses):
        if found is not None:
            cosine, sine = _fit_amplitudes(found, residual, response)
            frequency, rate = found.frequency / context.dt, found.rate / context.dt**2
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
    parameters=_input_parameters,
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
