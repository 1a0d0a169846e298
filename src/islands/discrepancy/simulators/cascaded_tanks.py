"""Two tanks in cascade: a pump fills the upper one, the level of the lower one is measured."""

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

#: What the states are called.
UPPER, LOWER = "upper", "lower"

#: Where an estimate begins: how long the lower tank takes to empty, in parts of the record, and how high the
#: upper one stands beside the lower one.
_SLOW, _HIGH = np.geomspace(0.005, 0.2, 8), (0.3, 1.0, 3.0)


@dataclass(frozen=True, slots=True)
class CascadedTanksSimulator:
    """``x1' = k3 u - k1 sqrt(x1)``, ``x2' = k1 sqrt(x1) - k2 sqrt(x2)``, ``y = x2``.

    Both tanks are as wide as each other: the level of the upper one, which nobody measures, has the unit of
    the other's.

    Attributes
    ----------
    k1, k2, k3 : float
        Outflow of the upper and of the lower tank, and the pump's gain.
    initial : tuple of float
        Levels at the first sample, upper and lower.
    units : tuple of str
        Of input and output.
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
        """The three constants, and the levels at the first sample."""
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
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        return input_coordinate(context, output)

    def simulate(
        self, values: Signal, x: Signal, context: SimulationContext, own: Mapping[str, float], _forces: Forces
    ) -> Signal:
        """See `islands.discrepancy.interfaces.simulator.Simulator`."""
        k1, k2, k3, upper, lower = map(float, values)
        gain, offset = k3 * gain_over_time(own, context), k3 * own.get(f"input-offset:{UPPER}", 0.0)
        y = np.empty(x.size)
        cascade(
            *(x * gain + offset, context.get_intersample_values(x) * gain + offset, context.dt),
            (
                k1,
                own.get(f"outflow-law:{UPPER}", 0.0),
                own.get(f"state-clip:{UPPER}", inf),
                own.get(f"state-clip:{UPPER} caught", 0.0),
            ),
            (
                k2,
                own.get(f"outflow-law:{LOWER}", 0.0),
                own.get(f"state-clip:{LOWER}", inf),
                k3 * own.get(f"input-offset:{LOWER}", 0.0),
            ),
            *(max(upper, 0.0), max(lower, 0.0), y),
        )
        return y


def make_cascaded_tanks(
    given: Mapping[str, float], record: Dataset, estimation_samples: int
) -> CascadedTanksSimulator:
    """Make a simulator; estimate the parameters that are not given from the estimation part of a record.

    A start that holds the balance of mean flows for every pair of a grid, and the best of them: the analysis
    calibrates it.
    """
    record = record[:estimation_samples]
    u, y = np.ascontiguousarray(record.u[:, 0]), record.y
    units = (record.input_units[0] or "1", record.output_unit or "1")
    level, pumped = max(float(np.mean(y)), 1e-6), max(abs(float(np.mean(u))), 1e-6)
    starts = []
    for slow in _SLOW * record.samples * record.dt:
        for high in _HIGH:
            k2 = given.get("k2", 2.0 * sqrt(level) / slow)
            k1 = given.get("k1", k2 / sqrt(high))
            k3 = given.get("k3", k2 * sqrt(level) / pumped)
            start = max(float(y[0]), 0.0)
            starts.append(CascadedTanksSimulator(k1, k2, k3, (start * high, start), units))
    return min(starts, key=lambda simulator: float(np.mean((y - _free_run(simulator, u, record.dt)) ** 2)))


def _free_run(simulator: CascadedTanksSimulator, u: Signal, dt: float) -> Signal:
    context = SimulationContext(u, dt, {}, {}, 1.0, 1.0, *simulator.units, u.size * dt)
    values = np.array([parameter.nominal for parameter in simulator.parameters])
    return simulator.simulate(values, u, context, {}, ())
