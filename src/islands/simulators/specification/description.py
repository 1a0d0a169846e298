"""Specifications of simulators with given values, and of extended simulators."""

import json
from collections.abc import Mapping, Sequence

from islands.effects.interface.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect
from islands.models.latent import LatentModel
from islands.persistence.models import model_json
from islands.simulators.extended import SavedExtension
from islands.simulators.external import PythonFunctionSimulator, RecordedOutput
from islands.simulators.fmu.simulator import FmuSimulator
from islands.simulators.identified import NarxSimulator, ParametricSimulator
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.linear import LinearSimulator
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.output_equation import OutputEquation
from islands.simulators.specification.base import EffectSpec, FrameSpec, ScalesSpec, ValueSpec
from islands.simulators.specification.code import FmuSpec, ProgramSpec
from islands.simulators.specification.equations import OdeSpec, OutputEquationSpec
from islands.simulators.specification.table import (
    ColumnSpec,
    LinearSpec,
    LocalExtendedSpec,
    LocalSpec,
    ModelSpec,
    PhysicalSpec,
)


def describe_extension(
    simulator: Simulator,
    values: Signal,
    inputs: tuple[str, ...],
    output: str,
    shape: Mapping[str, float] | None = None,
) -> LocalSpec:
    """Return the specification of a simulator with given values.

    Initial states are left out, since they belong to one record.

    Parameters
    ----------
    simulator : Simulator
    values : ndarray, shape (parameters,)
    inputs, output
        Names of the signals.
    shape : mapping, optional
        Coefficients and slope of the terms that an identified model lacks, by name.
    """
    named = {
        parameter.name: float(value)
        for parameter, value in zip(simulator.parameters, values, strict=True)
        if not parameter.initial
    }
    match simulator:
        case SavedExtension():
            inner_size = start = len(simulator.simulator.parameters)
            found = []
            for effect in simulator.added:
                parameters = effect.parameters(simulator.scales)
                found.append(make_effect_spec(effect, parameters, values[start : start + len(parameters)]))
                start += len(parameters)
            return make_extended_spec(
                simulator.simulator, values[:inner_size], found, simulator.scales, inputs, output, shape
            ).model_copy(update={"tested": simulator.tested})
        case NarxSimulator():
            model = simulator.with_shape(values, shape) if shape else simulator.with_values(values)
            return ModelSpec(kind="model", model=json.loads(model_json(model)), name=simulator.name)
        case ParametricSimulator():
            document = json.loads(model_json(simulator.with_values(values)))
            return ModelSpec(kind="model", model=document, name=simulator.name)
        case FmuSimulator():
            return FmuSpec.from_system(simulator.model, simulator.system.with_values(named))
        case OdeSimulator(system=system):
            if system.is_built_in:
                return PhysicalSpec(kind=simulator.name, parameters=named, steps=system.steps)
            return OdeSpec.from_system(system.with_values(named))
        case RecordedOutput():
            return ColumnSpec(kind="column", column=simulator.column)
        case LinearSimulator():
            numerator, denominator, level, _ = simulator.split_values(values)
            return LinearSpec(
                kind="linear",
                order=denominator.size,
                delay=simulator.delay,
                numerator=tuple(numerator.tolist()),
                denominator=tuple(denominator.tolist()),
                level=level,
                reference_input=simulator.reference_input,
            )
        case PythonFunctionSimulator():
            path, _, function = simulator.source.rpartition(":")
            return ProgramSpec(kind="python", path=path, function=function, parameters=named)
    raise AssertionError(simulator)


def make_extended_spec(
    simulator: Simulator,
    values: Signal,
    effects: Sequence[EffectSpec],
    scales: SimulationContext,
    inputs: tuple[str, ...],
    output: str,
    shape: Mapping[str, float] | None = None,
) -> LocalExtendedSpec:
    """Return the specification of a simulator with effects; the arguments as of `describe_extension`."""
    intersample, oversampling, inner = InterSample.FOH, 1, simulator
    if isinstance(simulator, ResampledSimulator):
        intersample, oversampling = simulator.intersample, simulator.oversampling
        inner = simulator.simulator
    equation: OutputEquationSpec | None = None
    if isinstance(inner, OutputEquation):
        if inner.system.parameters:
            equation = OutputEquationSpec.from_system(inner.with_values(values).system)
        inner = inner.simulator
    return LocalExtendedSpec(
        inputs=inputs,
        output=output,
        core=describe_extension(inner, values[: len(inner.parameters)], inputs, output, shape),
        hold=intersample.value,
        times=oversampling,
        effects=tuple(effects),
        output_equation=equation,
        start=_find_start(inner, values),
        scales=ScalesSpec(
            dt=scales.dt,
            input_peak=scales.input_peak,
            output_peak=scales.output_peak,
            fitted_s=scales.fit_end_time,
            duration_s=scales.duration,
            frame=_make_frame_spec(scales.force_coordinate),
            step_width=scales.step_width,
        ),
    )


def _find_start(simulator: Simulator, values: Signal) -> dict[str, float]:
    """Return the states of equations or of a latent model at the first sample by name; empty for others."""
    core = simulator
    while isinstance(core, SavedExtension | ResampledSimulator | OutputEquation):
        core = core.simulator
    match core:
        case FmuSimulator():
            return {}
        case OdeSimulator():
            initial = dict(core.initial)
        case ParametricSimulator(model=LatentModel()):
            initial = {}
        case _:
            return {}
    prefix = "initial "
    return initial | {
        parameter.name.removeprefix(prefix): float(value)
        for parameter, value in zip(simulator.parameters, values, strict=False)
        if parameter.initial and parameter.name.startswith(prefix)
    }


def read_scales(given: ScalesSpec, u: Signal, dt: float, units: tuple[str, str]) -> SimulationContext:
    """Return the context with the scales of a document, for another input.

    Parameters
    ----------
    u : ndarray, shape (samples,)
    dt : float
    units : tuple of str
        Units of input and output; empty ones are 1.
    """
    frame = given.frame
    return SimulationContext(
        u=u,
        dt=dt,
        channels={},
        units={},
        input_peak=given.input_peak,
        output_peak=given.output_peak,
        input_unit=units[0] or "1",
        output_unit=units[1] or "1",
        fit_end_time=given.fitted_s,
        reference_duration=given.duration_s,
        force_coordinate=ForceCoordinate(
            frame.unit,
            frame.peak,
            frame.rate,
            frame.force_unit,
            frame.force,
            sign=frame.sense,
            is_dissipative=frame.dissipates,
            friction_smoothing=frame.sharp,
        ),
        step_width=given.step_width,
    )


def _make_frame_spec(coordinate: ForceCoordinate) -> FrameSpec:
    return FrameSpec(
        unit=coordinate.unit,
        peak=coordinate.peak,
        rate=coordinate.rate,
        force_unit=coordinate.force_unit,
        force=coordinate.force,
        sense=coordinate.sign,
        dissipates=coordinate.is_dissipative,
        sharp=coordinate.friction_smoothing,
    )


def make_effect_spec(effect: Effect, parameters: Sequence[Parameter], values: Signal) -> EffectSpec:
    """Return the specification of an effect with the values of its parameters."""
    return EffectSpec(
        name=effect.name,
        site=str(effect.site),
        parameters={
            parameter.name: ValueSpec(value=float(value), unit=parameter.unit)
            for parameter, value in zip(parameters, values, strict=True)
        },
    )
