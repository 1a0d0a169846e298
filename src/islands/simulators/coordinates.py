"""Force coordinates of simulators without and with inertia."""

import numpy as np

from islands.effects.interface.context import ForceCoordinate, Signal, SimulationContext


def input_coordinate(context: SimulationContext, output: Signal) -> ForceCoordinate:
    """Return the input as the coordinate, for simulators without inertia: forces are added to the output."""
    rate = float(np.std(context.take_differences(context.u))) / context.dt or 1.0
    return ForceCoordinate(
        context.input_unit, context.input_peak, rate, context.output_unit, peak_amplitude(output)
    )


def output_coordinate(context: SimulationContext, output: Signal) -> ForceCoordinate:
    """Return the output as the coordinate, for simulators with inertia: forces are added to the input."""
    rate = float(np.std(context.take_differences(output))) / context.dt or 1.0
    return ForceCoordinate(
        context.output_unit,
        peak_amplitude(output),
        rate,
        context.input_unit,
        context.input_peak,
        is_dissipative=True,
        friction_smoothing=0.02,
    )


def peak_amplitude(signal: Signal) -> float:
    """Return the largest absolute value; 1 if the signal is zero."""
    return float(np.max(np.abs(signal))) or 1.0
