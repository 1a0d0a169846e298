"""Simulator of a Functional Mock-up Unit, the exchange format of simulation tools."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import isinf

import numpy as np

from islands.data.channel_names import is_unit, normalise_unit
from islands.data.dataset import Dataset
from islands.discrepancy.effects.time_variation import GAIN_EFFECTS, gain_over_time
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.force import add_output_forces
from islands.discrepancy.interfaces.simulator import Forces
from islands.discrepancy.simulators.coordinates import input_coordinate, peak_amplitude
from islands.discrepancy.simulators.record_channels import find_channel, make_nominal_context, sample_channel
from islands.errors import RecordError
from islands.systems.fmu.fmi_description import FmiInterface
from islands.systems.fmu.fmu_instance import FmuRun, load_fmu
from islands.systems.fmu.fmu_model import FmuInitialValue, FmuModel, FmuParameter
from islands.systems.ode.lane_simulation import SampledSignal, interpolate_linearly

#: Numbers of steps of the integrator per sample that are tried until a nominal simulation does not diverge.
STEPS = (1, 2, 4, 8, 16, 32, 64, 128, 256)

#: Largest relative deviation of the sampling time from a multiple of the fixed step of an FMU.
_STEP_ERROR = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class FmuSimulator:
    """Simulation by an FMU; forces are added to the output.

    The FMU is loaded by the process that simulates, so that the simulator can be sent to other processes.

    Attributes
    ----------
    model : FmuModel
    initial : mapping
        Nominal values at the first sample by name.
    sizes : mapping
        Largest absolute values of these variables in a nominal simulation.
    channels : mapping
        Channels of the record by the names of the inputs.
    """

    model: FmuModel
    initial: Mapping[str, float]
    sizes: Mapping[str, float]
    channels: Mapping[str, str]
    parameters: tuple[Parameter, ...] = field(init=False)
    sites: frozenset[Site] = frozenset((Site.INPUT, Site.FORCE, Site.PARAMETER, Site.OUTPUT))
    supported_effects: frozenset[str] = GAIN_EFFECTS
    built_in_effects: frozenset[str] = frozenset()
    state_effects: tuple[Effect, ...] = ()

    def __post_init__(self) -> None:
        declared = (
            *(_make_parameter(each) for each in self.model.parameters if not each.fixed),
            *(self._make_initial(each) for each in self.model.initial),
        )
        object.__setattr__(self, "parameters", declared)

    @property
    def name(self) -> str:
        """Name of the file."""
        return self.model.description.name

    @property
    def is_continuous_time(self) -> bool:
        """Whether steps can be shorter than the sampling time, so that the input between samples matters."""
        description = self.model.description
        return description.interface == FmiInterface.MODEL_EXCHANGE or (
            description.has_variable_step and description.fixed_step is None
        )

    @property
    def tolerances(self) -> Mapping[str, float]:
        """Tolerances of the parameters that have one."""
        return {
            each.variable.name: each.tolerance
            for each in self.model.parameters
            if each.tolerance is not None and not each.fixed
        }

    def _make_initial(self, given: FmuInitialValue) -> Parameter:
        name, unit = given.variable.name, given.variable.unit
        nominal = self.initial[name]
        lower, upper = min(given.variable.lower, nominal), max(given.variable.upper, nominal)
        return Parameter(
            f"initial {name}", unit, nominal, 0.02 * self.sizes[name], lower, upper, initial=True
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
        """Simulate the output; NaN after a failure of the FMU. See `Simulator.simulate`."""
        gain = gain_over_time(effect_parameters, context)
        between = context.get_intersample_values(x) if self.is_continuous_time else np.stack([x, x])
        driving = SampledSignal(x * gain, between[0] * gain, between[1] * gain)
        y: Signal = self.run(values, driving, context).y[0]
        return y + add_output_forces(x, context, forces)

    def run(self, values: Signal, driving: SampledSignal, context: SimulationContext) -> FmuRun:
        """Simulate the output and the variables of ``initial``.

        Parameters
        ----------
        values : ndarray, shape (parameters,)
        driving : SampledSignal
            Input.
        """
        model, description = self.model, self.model.description
        given = {each.name: float(value) for each, value in zip(self.parameters, values, strict=True)}
        start_values = {
            each.variable.reference: given.get(each.variable.name, each.value) for each in model.parameters
        }
        states: dict[int, float] = {}
        for each in model.initial:
            values_at_start, key = (
                (start_values, each.variable.reference) if each.place < 0 else (states, each.place)
            )
            values_at_start[key] = given[f"initial {each.variable.name}"]
        steps = max(model.steps, 1)
        signals = {model.input.reference: driving, **self._sample_channels(driving.start.size, context)}
        return load_fmu(description.path, description.digest, description.interface).simulate(
            start_values,
            states,
            {reference: signal.refine(steps) for reference, signal in signals.items()},
            [model.output.reference, *(each.variable.reference for each in model.initial)],
            context.start_time,
            context.dt / steps,
            steps,
        )

    def _sample_channels(self, samples: int, context: SimulationContext) -> dict[int, SampledSignal]:
        """Return the channels, which are linear between their samples, by value reference."""
        found = {}
        for variable in self.model.channels:
            values = sample_channel(context, self.channels[variable.name], samples)
            held = SampledSignal(values, values, values)
            found[variable.reference] = interpolate_linearly(values) if self.is_continuous_time else held
        return found


def make_fmu_simulator(model: FmuModel, record: Dataset) -> FmuSimulator:
    """Make a simulator of an FMU for a record, which determines nominal values at the first sample.

    Raises
    ------
    RecordError
        The record has not the channels, the units or the sampling time of the FMU, or the simulation fails
        or diverges on it.
    ModelError
        The FMU cannot be loaded.
    """
    _check_units(model, record)
    _check_sampling_time(model, record.dt)
    name = model.description.name
    channels = {each.name: find_channel(each.name, record, f"{name} reads") for each in model.channels}
    first = {"input": float(record.u[0, 0]), "output": float(np.nan_to_num(record.y[0]))}
    initial = {each.variable.name: _find_initial(each, first) for each in model.initial}
    rough = FmuSimulator(model, initial, dict.fromkeys(initial, 1.0), channels)
    context = make_nominal_context(record)
    driving = SampledSignal(context.u, *context.get_intersample_values(context.u))
    if not rough.is_continuous_time:
        driving = SampledSignal(context.u, context.u, context.u)
    nominal = np.array([each.nominal for each in rough.parameters])
    is_integrated = model.description.interface == FmiInterface.MODEL_EXCHANGE
    for steps in STEPS if is_integrated and not model.steps else (model.steps,):
        rough = replace(rough, model=replace(model, steps=steps))
        found = rough.run(nominal, driving, context)
        if np.isfinite(found.y).all():
            break
    else:
        why = f" ({found.failure})" if found.failure else ""
        raise RecordError(
            f"the simulation {name} fails or diverges on this input{why}: check its parameters and units, "
            f"and the sampling time {record.dt:g} s"
        )
    peaks = {"input": peak_amplitude(context.u), "output": peak_amplitude(found.y[0])}
    sizes = {
        each.variable.name: peaks[each.sample_of] if each.sample_of else peak_amplitude(simulated)
        for each, simulated in zip(model.initial, found.y[1:], strict=True)
    }
    return replace(rough, sizes=sizes)


def _find_initial(given: FmuInitialValue, first: Mapping[str, float]) -> float:
    """Return a past sample of the record, or the start value of a variable."""
    value = first.get(given.sample_of, given.variable.start or 0.0)
    return min(max(value, given.variable.lower), given.variable.upper)


def _make_parameter(given: FmuParameter) -> Parameter:
    span = given.upper - given.lower
    scale = 0.01 * (abs(given.value) or (1.0 if isinf(span) else span))
    return Parameter(given.variable.name, given.variable.unit, given.value, scale, given.lower, given.upper)


def _check_units(model: FmuModel, record: Dataset) -> None:
    """Compare units that are known; other spellings, such as kg.m2, are not compared."""
    for what, variable, unit in (
        ("input", model.input, record.input_units[0]),
        ("output", model.output, record.output_unit),
    ):
        expected = variable.unit
        if is_unit(expected) and is_unit(unit) and normalise_unit(expected) != normalise_unit(unit):
            raise RecordError(
                f"the {what} {variable.name} of {model.description.name} is in {expected}, that of the "
                f"record in {unit}: convert the column"
            )


def _check_sampling_time(model: FmuModel, dt: float) -> None:
    step = model.description.fixed_step
    if step is None:
        return
    count = round(dt / step)
    if count < 1 or abs(dt - count * step) > _STEP_ERROR * step:
        raise RecordError(
            f"{model.description.name} has a fixed step of {step:g} s, of which the sampling time {dt:g} s "
            "is not a multiple: resample the record, or export the FMU with another step"
        )
