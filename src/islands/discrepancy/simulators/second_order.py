"""Mass on a spring and a damper."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from islands.data.dataset import Dataset
from islands.discrepancy.effects.baseline import input_offset
from islands.discrepancy.effects.time_variation import gain_over_time
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.force import pack_force_laws
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import output_coordinate
from islands.systems.mechanics import integrate_motion
from islands.systems.second_order import SecondOrder, estimate_second_order

#: Name of the state in effects.
FORCE = "force"


@dataclass(frozen=True, slots=True)
class SecondOrderSimulator:
    """``m x'' + c x' + k x = u + forces``; the coordinate is the output.

    Attributes
    ----------
    system : SecondOrder
        Nominal parameters.
    units : tuple of str
        Units of input and output.
    size : float
        Standard deviation of the output.
    """

    system: SecondOrder
    units: tuple[str, str]
    size: float
    name: str = "second-order"
    sites: frozenset[Site] = frozenset(Site)
    supported_effects: frozenset[str] = frozenset(("gain-step", "ageing"))
    built_in_effects: frozenset[str] = frozenset(("viscous",))
    state_effects: tuple[Effect, ...] = field(default=(input_offset(FORCE),))
    is_continuous_time: bool = True

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Mass, damping, stiffness, and the state at the first sample."""
        system, (force, length) = self.system, self.units
        natural_frequency = abs(system.stiffness / system.mass) ** 0.5
        # Scale and bounds are relative to critical damping, since the nominal damping may be close to zero.
        critical = 2.0 * natural_frequency * system.mass
        return (
            _make_parameter("m", f"{force} s^2/{length}", system.mass, 0.01),
            Parameter(
                "c",
                f"{force} s/{length}",
                system.damping,
                abs(0.03 * system.damping) + abs(1e-4 * critical),
                min(0.0, 10.0 * critical),
                max(0.0, 10.0 * critical),
                is_positive=True,
            ),
            _make_parameter("k", f"{force}/{length}", system.stiffness, 0.01),
            Parameter("initial position", length, system.position, 0.02 * self.size, initial=True),
            Parameter(
                "initial rate", f"{length}/s", system.rate, 0.02 * self.size * natural_frequency, initial=True
            ),
        )

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the output as the coordinate."""
        return output_coordinate(context, output)

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        mass, damping, stiffness, position, rate = map(float, values)
        gain, offset = (
            gain_over_time(effect_parameters, context),
            effect_parameters.get(f"input-offset:{FORCE}", 0.0),
        )
        begins = np.zeros(x.size, dtype=bool)
        begins[0] = True
        y = np.empty(x.size)
        integrate_motion(
            *(x * gain + offset, context.get_intersample_values(x) * gain + offset),
            *(context.dt, mass, damping, stiffness),
            pack_force_laws(forces, context, balance=True),
            *(begins, np.full(x.size, position), np.full(x.size, rate), y),
        )
        return y


def make_second_order(
    given: Mapping[str, float], record: Dataset, estimation_samples: int
) -> SecondOrderSimulator:
    """Make a simulator; estimate the parameters that are not given from the estimation part of a record.

    Of several recordings, the longest one is used.
    """
    record = record[:estimation_samples].longest_segment
    found = estimate_second_order(record.u[:, 0], record.y, record.dt, given)
    units = (record.input_units[0] or "1", record.output_unit or "1")
    return SecondOrderSimulator(found, units, float(np.std(record.y)))


def _make_parameter(name: str, unit: str, nominal: float, relative_scale: float) -> Parameter:
    ends = (0.05 * nominal, 20.0 * nominal)
    scale = relative_scale * abs(nominal)
    return Parameter(name, unit, nominal, scale, min(ends), max(ends), is_positive=True)
