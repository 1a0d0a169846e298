"""The coordinates of simulations without inertia, and of those that move."""

import numpy as np

from islands.discrepancy.interfaces.context import ForceCoordinate, Signal, SimulationContext


def input_coordinate(context: SimulationContext, output: Signal) -> ForceCoordinate:
    """Return the input as the coordinate: forces add to the output at once."""
    rate = float(np.std(np.diff(context.u))) / context.dt or 1.0
    return ForceCoordinate(
        context.input_unit, context.input_peak, rate, context.output_unit, peak_amplitude(output)
    )


def output_coordinate(context: SimulationContext, output: Signal) -> ForceCoordinate:
    """Return the output as the coordinate: forces act beside the input, and move it."""
    rate = float(np.std(np.diff(output))) / context.dt or 1.0
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
    """Return the largest absolute value."""
    return float(np.max(np.abs(signal))) or 1.0
