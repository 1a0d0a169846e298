"""Simulator of a system of ordinary differential equations that a user has written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf

import numpy as np

from islands.data.channel_names import parse_channel_name
from islands.data.dataset import Dataset
from islands.discrepancy.effects.baseline import input_offset
from islands.discrepancy.effects.nonlinearity import state_clip
from islands.discrepancy.effects.time_variation import gain_over_time
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.force import pack_force_laws
from islands.discrepancy.interfaces.simulator import Forces, SimulationRun
from islands.discrepancy.simulators.coordinates import input_coordinate, output_coordinate, peak_amplitude
from islands.errors import RecordError
from islands.systems.ode.lane_simulation import (
    LaneInput,
    SampledSignal,
    interpolate_linearly,
    make_time,
    simulate_lanes,
)
from islands.systems.ode.ode_expression import OdeExpression, Symbol
from islands.systems.ode.ode_program import OdeProgram, generate_program
from islands.systems.ode.ode_system import OdeParameter, OdeState, OdeSystem
from islands.systems.ode.system_document import MAX_STEPS

#: Prefix of the parameter that is added to the derivative of a state.
_OFFSET = "input_offset_"


#: Numbers of steps per sample that are tried until a nominal simulation does not diverge.
_STEPS = (1, 2, 4, 8, 16, 32, 64, 128, MAX_STEPS)


@dataclass(frozen=True, slots=True, eq=False)
class OdeSimulator:
    """``dx/dt = f(x, u, parameters, t)`` by RK4.

    Attributes
    ----------
    system : OdeSystem
    initial : mapping
        Nominal states at the first sample by name.
    sizes : mapping
        Largest absolute values of the states and of their derivatives (``dx/dt``) in a nominal simulation.
    channels : mapping
        Channels of the record by their names in the equations.
    parameters : tuple of Parameter
        Parameters that are not fixed, then the initial states that are not.
    """

    system: OdeSystem
    initial: Mapping[str, float]
    sizes: Mapping[str, float]
    channels: Mapping[str, str]
    parameters: tuple[Parameter, ...] = field(init=False)
    state_effects: tuple[Effect, ...] = field(init=False)
    sites: frozenset[Site] = field(init=False)
    supported_effects: frozenset[str] = frozenset(("gain-step", "ageing"))
    built_in_effects: frozenset[str] = frozenset()
    is_continuous_time: bool = True
    _programs: dict[tuple[object, ...], OdeProgram] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        system = self.system
        declared = (
            *(_make_parameter(each) for each in system.parameters if not each.fixed),
            *(self._make_initial(each) for each in system.states if not each.fixed),
        )
        sites = frozenset(Site) if system.force else frozenset(Site) - {Site.FORCE}
        object.__setattr__(self, "parameters", declared)
        object.__setattr__(self, "state_effects", tuple(self._make_state_effects()))
        object.__setattr__(self, "sites", sites)

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.system.name

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Tolerances of the parameters that have one."""
        return {each.name: each.tolerance for each in self.system.parameters if each.tolerance is not None}

    def _make_initial(self, state: OdeState) -> Parameter:
        nominal, size = self.initial[state.name], self.sizes[state.name]
        return Parameter(
            f"initial {state.name}", state.unit, nominal, 0.02 * size, state.lower, state.upper, initial=True
        )

    def _make_state_effects(self) -> list[Effect]:
        """Return an offset and a limit for each state that its equation does not merely define as a rate."""
        balances = [
            state
            for state, (_, right) in zip(self.system.states, self.system.derivatives, strict=True)
            if not isinstance(right, Symbol)
        ]
        return [
            *(
                input_offset(each.name, f"{each.unit or '1'}/s", self.sizes[f"d{each.name}/dt"])
                for each in balances
            ),
            *(
                state_clip(each.name, each.unit or "1", self.sizes[each.name], spills=False)
                for each in balances
            ),
        ]

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the coordinate of the table ``[force]``, or the input if there is none."""
        force = self.system.force
        if force is None:
            return input_coordinate(context, output)
        parts = [
            self._simulate_nominal(part, (Symbol(force.coordinate), force.drive)) for part in context.split()
        ]
        coordinate, drive = (np.concatenate([part[index] for part in parts]) for index in range(2))
        unit = {each.name: each.unit for each in self.system.states}.get(force.coordinate) or "1"
        found = output_coordinate(context, coordinate)
        return replace(
            found, unit=unit, force_unit=force.unit or context.input_unit, force=peak_amplitude(drive)
        )

    def simulate(
        self,
        values: Signal,
        x: Signal,
        context: SimulationContext,
        effect_parameters: Mapping[str, float],
        forces: Forces,
    ) -> Signal:
        """Simulate the output; see `Simulator.simulate`."""
        output: Signal = self.simulate_batch([SimulationRun(values, x, effect_parameters, forces)], context)[
            0
        ]
        return output

    def simulate_batch(self, runs: Sequence[SimulationRun], context: SimulationContext) -> Signal:
        """Simulate runs with the same effects and force laws; see `BatchSimulator.simulate_batch`."""
        offsets = tuple(name for name in self.initial if f"input-offset:{name}" in runs[0].effect_parameters)
        program = self._get_program(offsets, len(runs[0].forces))
        return self._run(program, offsets, runs, context)[:, 0]

    def _simulate_nominal(self, context: SimulationContext, outputs: tuple[OdeExpression, ...]) -> Signal:
        """Simulate expressions of the system at its nominal values, shape (expressions, samples)."""
        nominal = np.array([each.nominal for each in self.parameters])
        program = generate_program(self.system, outputs)
        return self._run(program, (), [SimulationRun(nominal, context.u, {}, ())], context)[0]

    def _get_program(self, offsets: tuple[str, ...], laws: int) -> OdeProgram:
        key = offsets, laws
        if key not in self._programs:
            system = self.system
            for name in offsets:
                added = f"{_OFFSET}{name}"
                system = system.with_term(name, Symbol(added), [OdeParameter(added, 0.0)])
            self._programs[key] = generate_program(system, laws=laws)
        return self._programs[key]

    def _run(
        self,
        program: OdeProgram,
        offsets: tuple[str, ...],
        runs: Sequence[SimulationRun],
        context: SimulationContext,
    ) -> Signal:
        steps = max(self.system.steps, 1)
        common = self._make_common_signals(runs[0].x.size, context)
        made: dict[bytes, SampledSignal] = {}
        lanes = []
        for run in runs:
            effects = run.effect_parameters
            known = run.intersample_values
            between = context.get_intersample_values(run.x) if known is None else known
            gain = gain_over_time(effects, context)
            if isinstance(gain, float):
                key = run.x.tobytes()
                if key not in made:
                    made[key] = SampledSignal(run.x, *between).refine(steps)
                signal = made[key]
            else:
                between = between * gain
                signal = SampledSignal(run.x * gain, between[0], between[1]).refine(steps)
            given = {each.name: float(v) for each, v in zip(self.parameters, run.values, strict=True)}
            lanes.append(
                LaneInput(
                    {
                        **{each.name: given.get(each.name, each.value) for each in self.system.parameters},
                        **{f"{_OFFSET}{name}": effects[f"input-offset:{name}"] for name in offsets},
                    },
                    {name: given.get(f"initial {name}", value) for name, value in self.initial.items()},
                    {**common, self.system.input: signal},
                    pack_force_laws(run.forces, context, balance=True) if run.forces else None,
                    self._find_limits(effects),
                )
            )
        return simulate_lanes(program, context.dt / steps, lanes)[:, :, ::steps]

    def _make_common_signals(self, samples: int, context: SimulationContext) -> dict[str, SampledSignal]:
        """Return the time and the channels, which are linear between their samples."""
        found = make_time(context.start_time, samples, context.dt)
        for name, recorded in self.channels.items():
            signal = context.channels[recorded]
            steps = np.arange(samples) * (signal.size / samples)
            found[name] = interpolate_linearly(np.interp(steps, np.arange(signal.size), signal))
        return {name: signal.refine(max(self.system.steps, 1)) for name, signal in found.items()}

    def _find_limits(self, effect_parameters: Mapping[str, float]) -> dict[str, tuple[float, float]]:
        found = {}
        for state in self.system.states:
            level = effect_parameters.get(f"state-clip:{state.name}", inf)
            lower, upper = max(state.lower, -level), min(state.upper, level)
            if (lower, upper) != (-inf, inf):
                found[state.name] = (lower, upper)
        return found


def _make_parameter(given: OdeParameter) -> Parameter:
    ends = (0.05 * given.value, 20.0 * given.value)
    lower = min(ends) if given.lower is None else given.lower
    upper = max(ends) if given.upper is None else given.upper
    scale = 0.01 * (abs(given.value) or upper - lower)
    return Parameter(given.name, given.unit, given.value, scale, lower, upper)


def make_ode_simulator(system: OdeSystem, record: Dataset) -> OdeSimulator:
    """Make a simulator of a system for a record, whose first output may determine an initial state.

    Raises
    ------
    RecordError
        The record has not the channels or the units of the equations, or the simulation diverges on it.
    """
    _check_units(system, record)
    channels = {name: _find_channel(name, record) for name in system.channels}
    first = float(np.nan_to_num(record.y[0]))
    initial = {each.name: _find_initial(each, system, first) for each in system.states}
    sized = [*initial, *(f"d{name}/dt" for name in initial)]
    rough = OdeSimulator(system, initial, dict.fromkeys(sized, 1.0), channels)
    part = record.longest_segment
    names, units = part.input_names, part.input_units
    signals = {name: np.ascontiguousarray(u) for name, u in zip(names, part.u.T, strict=True)}
    context = SimulationContext(
        u=signals[names[0]],
        dt=part.dt,
        channels=signals,
        units=dict(zip(names, units, strict=True)),
        input_peak=1.0,
        output_peak=1.0,
        input_unit=units[0] or "1",
        output_unit=part.output_unit or "1",
        fit_end_time=part.samples * part.dt,
    )
    expressions = tuple(Symbol(name) for name in initial) + tuple(right for _, right in system.derivatives)
    for steps in (system.steps,) if system.steps else _STEPS:
        rough = replace(rough, system=replace(system, steps=steps))
        sizes = [peak_amplitude(signal) for signal in rough._simulate_nominal(context, expressions)]
        if np.isfinite(sizes).all():
            break
    else:
        raise RecordError(
            f"the simulation {system.name} diverges on this input: check its equations, the values and units "
            "of its parameters, and the sampling time"
        )
    return replace(rough, sizes=dict(zip(sized, sizes, strict=True)))


def _find_initial(state: OdeState, system: OdeSystem, measured: float) -> float:
    if state.initial is not None:
        return state.initial
    value = measured if system.output == Symbol(state.name) else 0.0
    return min(max(value, state.lower), state.upper)


def _find_channel(name: str, record: Dataset) -> str:
    found = [each for each in record.input_names[1:] if each == name or parse_channel_name(each).stem == name]
    if len(found) != 1:
        others = ", ".join(record.input_names[1:]) or "none"
        raise RecordError(
            f"the equations read the channel {name}, and the channels of the record are {others}: give its "
            f"column as a channel, and name it {name} in the equations"
        )
    return found[0]


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
