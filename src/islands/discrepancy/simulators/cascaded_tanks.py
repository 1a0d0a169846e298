"""Two tanks in cascade: a pump fills the upper tank, the level of the lower tank is measured."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, sqrt

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.effects.baseline import input_offset
from islands.discrepancy.effects.nonlinearity import outflow_law, state_clip
from islands.discrepancy.effects.time_variation import gain_over_time
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import input_coordinate
from islands.systems.tanks import cascade

#: Name of the level of the upper tank in effects.
UPPER = "upper"

#: Name of the level of the lower tank in effects.
LOWER = "lower"

#: Trial values of the time in which the lower tank empties, relative to the duration of the record.
_EMPTYING_TIMES = np.geomspace(0.005, 0.2, 8)

#: Trial values of the level of the upper tank, relative to that of the lower tank.
_LEVEL_RATIOS = (0.3, 1.0, 3.0)


@dataclass(frozen=True, slots=True)
class CascadedTanksSimulator:
    """``x1' = k3 u - k1 sqrt(x1)``, ``x2' = k1 sqrt(x1) - k2 sqrt(x2)``, ``y = x2``.

    Both tanks have the same cross section. The level of the upper tank is not measured and has the unit of
    the output.

    Attributes
    ----------
    k1, k2, k3 : float
        Outflow constants of the upper and of the lower tank, and gain of the pump.
    initial : tuple of float
        Levels of the upper and of the lower tank at the first sample.
    units : tuple of str
        Units of input and output.
    """

    k1: float
    k2: float
    k3: float
    initial: tuple[float, float]
    units: tuple[str, str]
    name: str = "cascaded-tanks"
    sites: frozenset[Site] = frozenset((Site.INPUT, Site.CORE, Site.PARAMETER, Site.OUTPUT))
    supported_effects: frozenset[str] = frozenset(("gain-step", "ageing"))
    built_in_effects: frozenset[str] = frozenset()
    state_effects: tuple[Effect, ...] = field(
        default=tuple(
            make(state) for make in (state_clip, input_offset, outflow_law) for state in (UPPER, LOWER)
        )
    )
    is_continuous_time: bool = True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Constants k1, k2, k3, and the levels at the first sample."""
        pump, level = self.units
        flow = f"{level}^0.5/s"
        return (
            *(
                Parameter(name, unit, value, 0.02 * value, 0.02 * value, 50.0 * value)
                for name, unit, value in (
                    ("k1", flow, self.k1),
                    ("k2", flow, self.k2),
                    ("k3", f"{level}/s/{pump}", self.k3),
                )
            ),
            *(
                Parameter(f"initial {name} level", level, value, 0.02 * abs(value) + 1e-3, 0.0, initial=True)
                for name, value in zip((UPPER, LOWER), self.initial, strict=True)
            ),
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
        _forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        k1, k2, k3, upper, lower = map(float, values)
        gain, offset = (
            k3 * gain_over_time(effect_parameters, context),
            k3 * effect_parameters.get(f"input-offset:{UPPER}", 0.0),
        )
        y = np.empty(x.size)
        cascade(
            *(x * gain + offset, context.get_intersample_values(x) * gain + offset, context.dt),
            (
                k1,
                effect_parameters.get(f"outflow-law:{UPPER}", 0.0),
                effect_parameters.get(f"state-clip:{UPPER}", inf),
                effect_parameters.get(f"state-clip:{UPPER} caught", 0.0),
            ),
            (
                k2,
                effect_parameters.get(f"outflow-law:{LOWER}", 0.0),
                effect_parameters.get(f"state-clip:{LOWER}", inf),
                k3 * effect_parameters.get(f"input-offset:{LOWER}", 0.0),
            ),
            *(max(upper, 0.0), max(lower, 0.0), y),
        )
        return y


def make_cascaded_tanks(
    given: Mapping[str, float], record: Dataset, estimation_samples: int
) -> CascadedTanksSimulator:
    """Make a simulator; estimate the parameters that are not given from the estimation part of a record.

    Of several recordings, the longest one is used.

    Each point of a grid satisfies the balance of mean flows. The point whose free run has the smallest error
    is the initial value of the calibration.
    """
    record = record[:estimation_samples].longest_segment
    u, y = np.ascontiguousarray(record.u[:, 0]), record.y
    units = (record.input_units[0] or "1", record.output_unit or "1")
    level, pumped = max(float(np.mean(y)), 1e-6), max(abs(float(np.mean(u))), 1e-6)
    candidates = []
    for emptying_time in _EMPTYING_TIMES * record.samples * record.dt:
        for ratio in _LEVEL_RATIOS:
            k2 = given.get("k2", 2.0 * sqrt(level) / emptying_time)
            k1 = given.get("k1", k2 / sqrt(ratio))
            k3 = given.get("k3", k2 * sqrt(level) / pumped)
            lower = max(float(y[0]), 0.0)
            candidates.append(CascadedTanksSimulator(k1, k2, k3, (lower * ratio, lower), units))
    return min(
        candidates,
        key=lambda simulator: float(np.mean((y - _simulate_nominal(simulator, u, record.dt)) ** 2)),
    )


def _simulate_nominal(simulator: CascadedTanksSimulator, u: Signal, dt: float) -> Signal:
    context = SimulationContext(u, dt, {}, {}, 1.0, 1.0, *simulator.units, u.size * dt)
    values = np.array([parameter.nominal for parameter in simulator.parameters])
    return simulator.simulate(values, u, context, {}, ())
