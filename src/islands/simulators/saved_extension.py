"""Extended simulation that was saved: it can be simulated, and diagnosed again."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from islands.effects.interface.context import Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect
from islands.records.signal_ranges import RangeLike
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.interface import Forces, SimulatorWrapper


@dataclass(frozen=True, slots=True, eq=False)
class SavedExtension(SimulatorWrapper):
    """Simulator with effects and their calibrated values.

    Attributes
    ----------
    simulator : Simulator
        Simulator without the effects, with the intersample behaviour that the record required.
    added : tuple of Effect
    values : ndarray, shape (parameters,)
        Nominal values of the parameters of the effects.
    scales : SimulationContext
        Scales of the record in which the effects were found; some strengths are relative to its peaks or its
        duration.
    tested : tuple of RangeLike
        Ranges of the inputs and of the output in which the extension was tested; empty if they are not known.
    """

    added: tuple[Effect, ...]
    values: Signal
    scales: SimulationContext
    tested: tuple[RangeLike, ...] = ()

    @property
    def name(self) -> str:
        """Names of the simulator and of the effects."""
        return " + ".join([self.simulator.name, *(effect.name for effect in self.added)])

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of the simulator, then those of each effect, prefixed with the name of the effect."""
        found, at = list(self.simulator.parameters), 0
        for effect in self.added:
            for parameter in effect.parameters(self.scales):
                name = f"{effect.name} {parameter.name}"
                found.append(replace(parameter, name=name, nominal=float(self.values[at])))
                at += 1
        return tuple(found)

    @property
    def is_continuous_time(self) -> bool:
        """False: the intersample behaviour is already selected."""
        return False

    @property
    def built_in_effects(self) -> frozenset[str]:
        """Built-in effects of the simulator, and the added effects."""
        return self.simulator.built_in_effects | {effect.name for effect in self.added}

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        scales = self.scales
        inner = replace(
            context,
            u=np.ascontiguousarray(x),
            input_peak=scales.input_peak,
            output_peak=scales.output_peak,
            fit_end_time=scales.fit_end_time,
            reference_duration=scales.duration,
            step_width=scales.step_width,
            force_coordinate=scales.force_coordinate,
        )
        return ExtendedSimulator(self.simulator, self.added, inner).simulate(
            values, effect_parameters, forces
        )
