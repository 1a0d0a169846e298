"""Preparation of the equations of a user for a record: units, channels, initial states, sizes, and steps."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from islands.errors import RecordError
from islands.expressions.tree import Symbol
from islands.records.dataset import Dataset
from islands.simulators.coordinates import peak_amplitude
from islands.simulators.ode.record_channels import find_channel, make_nominal_context
from islands.simulators.ode.shooting import make_shots
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.ode.system import OdeSystem
from islands.simulators.ode.system_document import MAX_STEPS
from islands.simulators.ode.system_parts import OdeState

#: Numbers of steps per sample that are tried until a nominal simulation does not diverge.
_STEPS = (1, 2, 4, 8, 16, 32, 64, 128, MAX_STEPS)


def make_ode_simulator(
    system: OdeSystem, record: Dataset, estimated: Mapping[str, float] | None = None
) -> OdeSimulator:
    """Make a simulator of a system for a record, whose first output may determine an initial state.

    Parameters
    ----------
    system : OdeSystem
    record : Dataset
    estimated : mapping, optional
        Estimates of states at the first sample, by name.

    Raises
    ------
    RecordError
        The record has not the channels or the units of the equations, or the simulation diverges on it.
    """
    _check_units(system, record)
    estimated = estimated or {}
    system = fill_units(system, record.input_units[0], record.output_unit)
    channels = {name: find_channel(name, record, "the equations read") for name in system.channels}
    first = float(np.nan_to_num(record.y[0]))
    initial = {each.name: _find_initial(each, system, first) for each in system.states}
    initial |= estimated
    # Extended equations start from the estimates on other records, except the state that is measured.
    hidden = {name: value for name, value in estimated.items() if system.output != Symbol(name)}
    system = replace(
        system,
        states=tuple(replace(each, initial=hidden.get(each.name, each.initial)) for each in system.states),
    )
    sized = [*initial, *(f"d{name}/dt" for name in initial)]
    shots = make_shots(system, record) if system.shooting else None
    rough = OdeSimulator(system, initial, dict.fromkeys(sized, 1.0), channels, shots)
    rough = rough.for_samples(*max(record.bounds, key=lambda bounds: bounds[1] - bounds[0]))
    context = make_nominal_context(record)
    expressions = tuple(Symbol(name) for name in initial) + tuple(right for _, right in system.derivatives)
    # Equations without states have an output only.
    expressions = expressions or (system.output,)
    for steps in (system.steps,) if system.steps else _STEPS:
        rough = replace(rough, system=replace(system, steps=steps))
        sizes = [peak_amplitude(signal) for signal in rough.simulate_nominal(context, expressions)]
        if np.isfinite(sizes).all():
            break
    else:
        raise RecordError(
            f"the simulation {system.name} diverges on this input: check its equations, the values and units "
            "of its parameters, and the sampling time"
        )
    return replace(rough, sizes=dict(zip(sized, sizes, strict=bool(sized))), shots=shots)


def _find_initial(state: OdeState, system: OdeSystem, measured: float) -> float:
    if state.initial is not None:
        return state.initial
    value = measured if system.output == Symbol(state.name) else 0.0
    return min(max(value, state.lower), state.upper)


def _check_units(system: OdeSystem, record: Dataset) -> None:
    for what, expected, unit in (
        ("input", system.input_unit, record.input_units[0]),
        ("output", system.output_unit, record.output_unit),
    ):
        if expected and unit and expected != unit:
            raise RecordError(
                f"the {what} of {system.name} is in {expected}, that of the record in {unit}: convert the "
                f"column, or write the equations for {unit}"
            )


def fill_units(system: OdeSystem, input_unit: str, output_unit: str) -> OdeSystem:
    """Return a system in which ``{input}`` and ``{output}`` in units are those of a record."""
    given = {"{input}": input_unit or "1", "{output}": output_unit or "1"}

    def fill(unit: str) -> str:
        for name, own in given.items():
            unit = unit.replace(name, own)
        return unit

    return replace(
        system,
        parameters=tuple(replace(each, unit=fill(each.unit)) for each in system.parameters),
        states=tuple(replace(each, unit=fill(each.unit)) for each in system.states),
    )
