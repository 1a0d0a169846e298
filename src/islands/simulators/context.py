"""Context of the simulation of a record: its input, and its scales."""

from dataclasses import replace

import numpy as np

from islands.effects.interface.context import SimulationContext
from islands.errors import RecordError
from islands.records.dataset import Dataset
from islands.records.segments import fill_gaps, is_resting
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Simulator, peak_amplitude


def make_context(record: Dataset, simulator: Simulator, fitted: int) -> SimulationContext:
    """Make the context of a simulation: its input, and the scales of the record.

    Parameters
    ----------
    fitted : int
        Number of samples used for estimation.

    Raises
    ------
    RecordError
        The simulation diverges on the input.
    """
    names, units = record.input_names, record.input_units
    context = SimulationContext(
        u=np.ascontiguousarray(record.u[:, 0]),
        dt=record.dt,
        channels={
            name: np.ascontiguousarray(record.u[:, index]) for index, name in enumerate(names) if index
        },
        units=dict(zip(names[1:], units[1:], strict=True)),
        input_peak=peak_amplitude(record.u[:, 0]),
        output_peak=1.0,
        input_unit=units[0] or "1",
        output_unit=record.output_unit or "1",
        fit_end_time=fitted * record.dt,
        segments=record.segments,
        measured=fill_gaps(record.y),
    )
    simulation = ExtendedSimulator(simulator, (), context)
    nominal = simulation.simulate(simulation.nominal)
    if not np.isfinite(nominal).all():
        raise RecordError(
            f"the simulation {simulator.name} diverges on this input: check its parameters, its units and "
            "the sampling time"
        )
    peak = peak_amplitude(nominal)
    if is_resting(nominal[:fitted]):  # it may rest at zero, while the measured output creeps
        peak = max(float(np.max(np.abs(nominal))), peak_amplitude(record.y[~np.isnan(record.y)]))
    scaled = replace(context, output_peak=peak)
    return replace(scaled, force_coordinate=simulator.make_force_coordinate(scaled, nominal))
