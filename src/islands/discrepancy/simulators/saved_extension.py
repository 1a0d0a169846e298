"""A simulation with effects in it as a simulation of its own: it is simulated, and can be diagnosed again."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from islands.discrepancy.interfaces.context import Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.simulator import Forces, Simulator
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.intersample import SimulatorWrapper


@dataclass(frozen=True, slots=True, eq=False)
class SavedExtension(SimulatorWrapper):
    """A core and effects in it, with the values that were found.

    Attributes
    ----------
    simulator : Simulator
        Solved as the record asked for.
    added : tuple of Effect
    values : ndarray, shape (parameters,)
        Of the effects, one after the other: their nominal values from now on.
    scales : SimulationContext
        Of the record that they were found in: some strengths are parts of its peaks, or of its duration.
    """

    simulator: Simulator
    added: tuple[Effect, ...]
    values: Signal
    scales: SimulationContext

    @property
    def name(self) -> str:
        """The core's, and those of the effects."""
        return " + ".join([self.simulator.name, *(effect.name for effect in self.added)])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The core's, and those of each effect with the effect's name before them."""
        found, at = list(self.simulator.parameters), 0
        for effect in self.added:
            for parameter in effect.parameters(self.scales):
                name = f"{effect.name} {parameter.name}"
                found.append(replace(parameter, name=name, nominal=float(self.values[at])))
                at += 1
        return tuple(found)

    @property
    def is_continuous_time(self) -> bool:
        """It is solved already as its record asked for."""
        return False

    @property
    def built_in_effects(self) -> frozenset[str]:
        """What the core has, and what was added."""
        return self.simulator.built_in_effects | {effect.name for effect in self.added}

    def simulate(
        self, values: Signal, x: Signal, context: SimulationContext, own: Mapping[str, float], forces: Forces
    ) -> Signal:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        scales = self.scales
        inner = replace(
            context,
            u=np.ascontiguousarray(x),
            input_peak=scales.input_peak,
            output_peak=scales.output_peak,
            fit_end_time=scales.fit_end_time,
            reference_duration=scales.duration,
            force_coordinate=scales.force_coordinate,
        )
        return ExtendedSimulator(self.simulator, self.added, inner).simulate(values, own, forces)
