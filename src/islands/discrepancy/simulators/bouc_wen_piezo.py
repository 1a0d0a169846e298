"""Bouc-Wen piezoelectric actuator, equation (11) of the paper."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.effects.time_variation import gain_over_time
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.force import add_output_forces
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import input_coordinate
from islands.systems.bouc_wen import BoucWenPiezo
from islands.systems.hysteresis_operators import bouc_wen


@dataclass(frozen=True, slots=True)
class BoucWenPiezoSimulator:
    """``y = dp x - h + forces``, ``h' = A x' - beta |x'| h - gamma x' |h|``; the coordinate is the voltage.

    Attributes
    ----------
    piezo : BoucWenPiezo
        Nominal parameters; by default those of the paper.
    """

    piezo: BoucWenPiezo = field(default_factory=BoucWenPiezo)
    name: str = "bouc-wen-piezo"
    sites: frozenset[Site] = frozenset(Site)
    supported_effects: frozenset[str] = frozenset(
        ("relaxation", "rate-dependent-loop", "loop-asymmetry", "gain-step", "ageing")
    )
    built_in_effects: frozenset[str] = frozenset()
    state_effects: tuple[Effect, ...] = ()
    is_continuous_time: bool = True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """A, beta, gamma and dp, between a fifth and five times their nominal values."""
        return tuple(
            Parameter(name, unit, nominal, fraction * abs(nominal), *_make_bounds(nominal))
            for name, unit, nominal, fraction in (
                ("A", "um/V", self.piezo.A, 0.01),
                ("beta", "1/V", self.piezo.beta, 0.03),
                ("gamma", "1/V", self.piezo.gamma, 0.03),
                ("dp", "um/V", self.piezo.dp, 0.005),
            )
        )

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the input as the coordinate."""
        return input_coordinate(context, output)

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        A, beta, gamma, dp = values
        h = np.empty_like(x)
        bouc_wen(
            np.ascontiguousarray(x),
            *(context.dt, A, beta, gamma),
            *(
                effect_parameters.get("relaxation", 0.0),
                effect_parameters.get("rate-dependent-loop", 0.0),
                effect_parameters.get("loop-asymmetry", 0.0),
            ),
            *(0.0, h),
        )
        return dp * gain_over_time(effect_parameters, context) * x - h + add_output_forces(x, context, forces)


def make_bouc_wen_piezo(
    given: Mapping[str, float], _record: Dataset, _estimation_samples: int
) -> BoucWenPiezoSimulator:
    """Make a simulator; parameters that are not given have the values of the paper."""
    return BoucWenPiezoSimulator(replace(BoucWenPiezo(), **given))


def _make_bounds(nominal: float) -> tuple[float, float]:
    ends = (0.2 * nominal, 5.0 * nominal)
    return min(ends), max(ends)
