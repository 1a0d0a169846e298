"""Simulator of a system of ordinary differential equations that a user has written."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import isinf

import numpy as np

from islands.effects.interface.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.effects.interface.force import ForceLaw, pack_force_laws, sum_output_forces
from islands.effects.time_variation import GAIN_EFFECTS, gain_over_time
from islands.errors import RecordError
from islands.expressions.tree import Expression, Symbol
from islands.records.dataset import Dataset
from islands.simulators.interface import (
    BatchSimulator,
    SimulationRun,
    input_coordinate,
    output_coordinate,
    peak_amplitude,
)
from islands.simulators.ode.effects import (
    extend_system,
    find_effects,
    find_limits,
    is_term,
    list_terms,
    list_values,
    number_symbols,
)
from islands.simulators.ode.equation_parser import TIME
from islands.simulators.ode.lane_simulation import simulate_lanes
from islands.simulators.ode.lane_values import LaneInput
from islands.simulators.ode.program import OdeProgram, generate_program
from islands.simulators.ode.sampled_signal import (
    SampledSignal,
    find_channel,
    interpolate_linearly,
    make_nominal_context,
    make_time,
    refine_input,
    sample_channels,
)
from islands.simulators.ode.shooting import Shots, make_shots
from islands.simulators.ode.system import OdeEffect, OdeParameter, OdeState, OdeSystem
from islands.simulators.ode.system_document import MAX_STEPS

#: Name of the factor of the parameter that is the gain; no name in equations has brackets.
_GAIN = "gain(t)"

#: Numbers of steps per sample that are tried until a nominal simulation does not diverge.
_STEPS = (1, 2, 4, 8, 16, 32, 64, 128, MAX_STEPS)


@dataclass(frozen=True, slots=True, eq=False)
class OdeSimulator(BatchSimulator):
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
    shots : Shots or None
        Shooting intervals; None for a free run.
    parameters : tuple of Parameter
        Parameters that are not fixed, then the initial states that are not.
    is_continuous_time : bool
        Whether the input between samples matters; otherwise it is held.
    """

    system: OdeSystem
    initial: Mapping[str, float]
    sizes: Mapping[str, float]
    channels: Mapping[str, str]
    shots: Shots | None = None
    parameters: tuple[Parameter, ...] = field(init=False)
    state_effects: tuple[Effect, ...] = field(init=False)
    supported_effects: frozenset[str] = field(init=False)
    is_continuous_time: bool = True
    _programs: dict[tuple[object, ...], OdeProgram] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        system = self.system
        free = (make_parameter(each) for each in system.parameters if not each.fixed)
        supported, of_states = find_effects(system, self.sizes)
        object.__setattr__(self, "parameters", (*free, *self._list_initial_states()))
        object.__setattr__(self, "state_effects", of_states)
        object.__setattr__(self, "supported_effects", supported)

    @property
    def name(self) -> str:
        """Name of the system."""
        return self.system.name

    @property
    def equations(self) -> str:
        """Differential equations, and the equation of the output."""
        return self.system.write_equations()

    @property
    def sites(self) -> frozenset[Site]:
        """All sites, but that of forces only if the system tells where they act."""
        return frozenset(Site) if self.system.force else frozenset(Site) - {Site.FORCE}

    @property
    def built_in_effects(self) -> frozenset[str]:
        """Names of the effects that the equations contain."""
        return frozenset(self.system.contains)

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Tolerances of the parameters that have one."""
        free = (parameter for parameter in self.system.parameters if not parameter.fixed)
        return {each.name: each.tolerance for each in free if each.tolerance is not None}

    @property
    def read_channels(self) -> frozenset[str]:
        """Channels that the equations read."""
        return frozenset(self.channels.values())

    @property
    def fits_states(self) -> bool:
        """Whether there are shooting intervals."""
        return self.shots is not None

    def _list_initial_states(self) -> tuple[Parameter, ...]:
        return tuple(
            self._make_initial(each.name, each.unit, each.lower, each.upper)
            for each in self.system.states
            if not (each.fixed or self.shots)
        )

    def _make_initial(self, name: str, unit: str, lower: float, upper: float) -> Parameter:
        scale = 0.02 * self.sizes[name]
        return Parameter(f"initial {name}", unit, self.initial[name], scale, lower, upper, initial=True)

    def make_force_coordinate(self, context: SimulationContext, output: Signal) -> ForceCoordinate:
        """Return the coordinate of the table ``[force]``; the input if there is none, or if it says so."""
        force = self.system.force
        if force is None or not force.rate:
            return input_coordinate(context, output)
        expressions = Symbol(force.coordinate), force.drive
        parts = [
            self.for_samples(*ends).simulate_nominal(part, expressions)
            for ends, part in zip(context.bounds, context.split(), strict=True)
        ]
        coordinate, drive = np.concatenate(parts, axis=1)
        units = {each.name: each.unit for each in self.system.states}
        return replace(
            output_coordinate(context, coordinate),
            unit=units.get(force.coordinate) or "1",
            force_unit=force.unit or context.input_unit,
            force=peak_amplitude(drive),
            is_output=self.system.output == Symbol(force.coordinate),
        )

    def simulate_batch(
        self, runs: Sequence[SimulationRun], context: SimulationContext, every: int = 1
    ) -> Signal:
        """Simulate runs with the same effects and force laws; see `Simulator.simulate_batch`."""
        active = tuple(
            each for each in list_terms(self.system) if each.name in runs[0].effect_parameters and each.term
        )
        has_factor = bool(self.system.gain) and not GAIN_EFFECTS.isdisjoint(runs[0].effect_parameters)
        laws = runs[0].forces if self._has_force_equation else ()
        program = self._get_program(active, has_factor, tuple(law for law, _ in laws))
        if self.shots is None:
            lanes = self._make_lanes(program, active, runs, context)
            outputs = self._integrate(program, lanes, context, every)[:, 0]
        else:
            outputs = self._fit_shots(self.shots, program, active, runs, context)[:, ::every]
        if not self._has_force_equation and runs[0].forces:
            inputs = {run.input_key: run.apply_characteristic(run.x, context.dt) for run in runs}
            coordinates = [inputs[run.input_key] for run in runs]
            further = sum_output_forces(coordinates, context, [run.forces for run in runs])
            outputs = outputs + further[:, ::every]
        return outputs

    @property
    def _steps(self) -> int:
        return max(self.system.steps, 1)

    @property
    def _has_force_equation(self) -> bool:
        """Whether forces act in an equation, and not on the output."""
        return self.system.force is not None and bool(self.system.force.rate)

    def simulate_nominal(self, context: SimulationContext, outputs: tuple[Expression, ...]) -> Signal:
        """Simulate expressions of the system at its nominal values, shape (expressions, samples)."""
        nominal = np.array([each.nominal for each in self.parameters])
        program = generate_program(self.system, outputs)
        lanes = self._make_lanes(program, (), [SimulationRun(nominal, context.u, {}, ())], context)
        if self.shots is None:
            return self._integrate(program, lanes, context)[0]
        dt = context.dt / self._steps
        return self.shots.make_simulation(program, dt, lanes, self.initial, self._steps).simulate_starts()[0]

    def _fit_shots(
        self,
        shots: Shots,
        program: OdeProgram,
        active: tuple[OdeEffect, ...],
        runs: Sequence[SimulationRun],
        context: SimulationContext,
    ) -> Signal:
        """Simulate runs with fitted states at each shooting interval; between samples outputs are held."""
        oversampling = runs[0].x.size // shots.measured.size
        lanes = self._make_lanes(program, active, runs, context)
        sizes = {each.name: self.sizes[each.name] for each in self.system.states if not each.fixed}
        dt, every = context.dt / self._steps, oversampling * self._steps
        simulation = shots.make_simulation(program, dt, lanes, self.initial, every)
        fitted = simulation.fit_states(sizes, [run.near for run in runs])
        return np.repeat(fitted, oversampling, axis=1)

    def for_samples(self, first: int, last: int) -> "OdeSimulator":
        """Return the simulator of one recording."""
        return replace(self, shots=self.shots.for_samples(first, last)) if self.shots else self

    def _get_program(
        self, active: tuple[OdeEffect, ...], has_factor: bool, laws: tuple[ForceLaw, ...]
    ) -> OdeProgram:
        key = active, has_factor, laws
        if key not in self._programs:
            terms = [(number_symbols(number), law) for number, law in enumerate(laws) if is_term(law)]
            calls = len(laws) - len(terms)
            factor = _GAIN if has_factor else ""
            system = extend_system(self.system, active, factor, terms, has_others=calls > 0)
            self._programs[key] = generate_program(system, laws=calls)
        return self._programs[key]

    def _integrate(
        self, program: OdeProgram, lanes: Sequence[LaneInput], context: SimulationContext, every: int = 1
    ) -> Signal:
        dt, every = context.dt / self._steps, every * self._steps
        return self._simulate_lanes(program, context.start_time, dt, lanes, every)

    def _simulate_lanes(
        self,
        program: OdeProgram,
        _start_time: float,
        dt: float,
        lanes: Sequence[LaneInput],
        every: int,
    ) -> Signal:
        """Simulate the outputs of a program, shape (lanes, outputs, samples)."""
        return simulate_lanes(program, dt, lanes, every)

    def _make_lanes(
        self,
        program: OdeProgram,
        active: tuple[OdeEffect, ...],
        runs: Sequence[SimulationRun],
        context: SimulationContext,
    ) -> list[LaneInput]:
        steps, samples = self._steps, runs[0].x.size
        common = make_time(context.start_time, samples, context.dt) if Symbol(TIME) in program.signals else {}
        common |= sample_channels(context, self.channels, samples, is_held=not self.is_continuous_time)
        common = {name: signal.refine(steps) for name, signal in common.items()}
        refined: dict[int, SampledSignal] = {}
        made: dict[tuple[int, int], SampledSignal] = {}
        names = [parameter.name for parameter in self.parameters]
        fixed = {parameter.name: parameter.value for parameter in self.system.parameters}
        lanes = []
        for run in runs:
            effects = run.effect_parameters
            gain = gain_over_time(effects, context)
            signals = dict(common)
            if run.input_key not in made:
                if id(run.x) not in refined:
                    refined[id(run.x)] = refine_input(run.x, self._get_between(run, context), steps)
                moments = refined[id(run.x)].moments
                mapped = run.apply_characteristic(moments, context.dt / steps)
                made[run.input_key] = SampledSignal(mapped, has_kinks=run.characteristic is not None)
            driving = made[run.input_key]
            if not isinstance(gain, float):
                if self.system.gain:
                    signals[_GAIN] = interpolate_linearly(gain).refine(steps)
                else:
                    driving = driving.scale(np.repeat(gain, steps))
            signals[self.system.input] = driving
            given = dict(zip(names, run.values.tolist(), strict=True))
            laws = list(enumerate(run.forces)) if self._has_force_equation else []
            calls = [law for _, law in laws if not is_term(law[0])]
            numbers, states = list_values([law for law in laws if is_term(law[1][0])], context)
            lanes.append(
                LaneInput(
                    {**fixed, **given, **{each.name: effects[each.name] for each in active}, **numbers},
                    {
                        **{name: given.get(f"initial {name}", value) for name, value in self.initial.items()},
                        **states,
                    },
                    signals,
                    pack_force_laws(calls, context, balance=True) if calls else None,
                    *find_limits(self.system, effects),
                )
            )
        return lanes

    def _get_between(self, run: SimulationRun, context: SimulationContext) -> Signal:
        """Return the values of the input between the samples, shape (2, samples)."""
        if not self.is_continuous_time:
            return np.stack([run.x, run.x])
        if run.intersample_values is None:
            return context.get_intersample_values(run.x)
        return run.intersample_values


def make_parameter(given: OdeParameter) -> Parameter:
    """Return a parameter of equations as that of a simulator, with its bounds and its typical change."""
    ends = (0.05 * given.value, 20.0 * given.value)
    lower = min(ends) if given.lower is None else given.lower
    upper = max(ends) if given.upper is None else given.upper
    scale = 0.01 * (abs(given.value) or (1.0 if isinf(upper - lower) else upper - lower))
    return Parameter(given.name, given.unit, given.value, scale, lower, upper, is_positive=given.positive)


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
    initial = {state.name: _find_initial(state, system, first) for state in system.states}
    initial |= estimated
    # Extended equations start from the estimates on other records, except the state that is measured.
    hidden = {name: value for name, value in estimated.items() if system.output != Symbol(name)}
    system = replace(
        system,
        states=tuple(
            replace(state, initial=hidden.get(state.name, state.initial)) for state in system.states
        ),
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
        parameters=tuple(replace(parameter, unit=fill(parameter.unit)) for parameter in system.parameters),
        states=tuple(replace(state, unit=fill(state.unit)) for state in system.states),
    )
