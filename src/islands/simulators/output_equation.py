"""Equation of the output around a simulation that has no equations, to which terms can be added."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.expressions.evaluation import evaluate
from islands.simulators.interface import (
    BatchSimulator,
    SimulationRun,
    Simulator,
    SimulatorWrapper,
)
from islands.simulators.ode.equation_parser import TIME
from islands.simulators.ode.simulator import make_parameter
from islands.simulators.ode.system import OdeSystem
from islands.simulators.ode.system_document import INPUT, SIMULATED, make_output_system

#: Rate of the input in the equation, by central differences.
RATE = f"rate({INPUT})"


@dataclass(frozen=True, slots=True, eq=False)
class OutputEquation(SimulatorWrapper, BatchSimulator):
    """Simulation whose output is an expression of that of another one, of its input, and of the time.

    Attributes
    ----------
    simulator : Simulator
        The simulation that computes ``y_sim``.
    system : OdeSystem
        System without states. Its parameters follow those of the simulation.
    sizes : mapping
        Largest absolute value of ``y_sim`` in a nominal simulation.
    parameters : tuple of Parameter
        Parameters of the simulation, then those of the equation.
    """

    system: OdeSystem
    sizes: Mapping[str, float]
    parameters: tuple[Parameter, ...] = field(init=False)

    def __post_init__(self) -> None:
        parameters = (*self.simulator.parameters, *map(make_parameter, self.system.parameters))
        object.__setattr__(self, "parameters", parameters)

    def with_values(self, values: Signal) -> "OutputEquation":
        """Return the equation with other nominal values of its parameters, the last of ``values``."""
        names = [each.name for each in self.system.parameters]
        own = dict(zip(names, values[values.size - len(names) :].tolist(), strict=True))
        return replace(self, system=self.system.with_values(own))

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate several runs; those that differ only in the equation share a run of the simulation."""
        if not self.system.parameters:
            return self.simulator.simulate_batch(runs, context, every)
        count = len(self.simulator.parameters)
        distinct: dict[tuple[object, ...], SimulationRun] = {}
        keys = []
        for run in runs:
            forces = tuple((id(law), own.tobytes()) for law, own in run.forces)
            key = (run.values[:count].tobytes(), run.input_key, tuple(run.effect_parameters.items()), forces)
            distinct.setdefault(key, replace(run, values=run.values[:count]))
            keys.append(key)
        outputs = self.simulator.simulate_batch(list(distinct.values()), context)
        simulated = dict(zip(distinct, outputs, strict=True))
        names = [parameter.name for parameter in self.system.parameters]
        signals: dict[tuple[int, int], dict[str, Signal]] = {}
        found = []
        for run, key in zip(runs, keys, strict=True):
            if run.input_key not in signals:
                u = run.apply_characteristic(run.x, context.dt)
                signals[run.input_key] = {INPUT: u, RATE: np.gradient(u) / context.dt, TIME: context.time}
            own = dict(zip(names, run.values[count:].tolist(), strict=True))
            known = {**signals[run.input_key], SIMULATED: simulated[key], **own}
            found.append(evaluate(self.system.output, known))
        return np.stack(found)[:, ::every]


def add_output_equation(simulator: Simulator, context: SimulationContext) -> OutputEquation:
    """Return a simulation with the equation ``output = y_sim`` and the scales of a record."""
    return OutputEquation(simulator, make_output_system(simulator.name), {SIMULATED: context.output_peak})
