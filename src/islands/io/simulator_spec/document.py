"""Extended simulations as documents: ``extended.json``, which can be used as a simulation."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from islands.data.dataset import Dataset
from islands.diagnosis.calibration.levenberg_marquardt import CalibrationResult
from islands.effects import model_form
from islands.effects.interface.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.effects.interface.effect import Effect, Site
from islands.io.models import model_json
from islands.io.simulator_spec.code_spec import FmuSpec, ProgramSpec
from islands.io.simulator_spec.ode_spec import OdeSpec, OutputEquationSpec
from islands.io.simulator_spec.spec_base import EffectSpec, FrameSpec, ScalesSpec, ValueSpec
from islands.io.simulator_spec.specification import (
    ColumnSpec,
    LinearSpec,
    LocalExtendedSpec,
    LocalSpec,
    ModelSpec,
    PhysicalSpec,
)
from islands.simulators.extended import ExtendedSimulator
from islands.simulators.fmu.simulator import FmuSimulator
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.linear import LinearSimulator
from islands.simulators.narx import NarxSimulator
from islands.simulators.ode.simulator import OdeSimulator
from islands.simulators.output_equation import OutputEquation
from islands.simulators.parametric import ParametricSimulator
from islands.simulators.python_function import PythonFunctionSimulator
from islands.simulators.recorded_output import RecordedOutput
from islands.simulators.saved_extension import SavedExtension


def extended_json(fit: CalibrationResult, record: Dataset) -> str:
    """Return ``extended.json``: a simulator with its effects and the values of both."""
    return json.dumps(extended_document(fit, record), indent=2, allow_nan=False) + "\n"


def extended_document(fit: CalibrationResult, record: Dataset) -> dict[str, Any]:
    """Return a simulator with its effects and the values of both as a JSON document.

    Wrong parameters are corrected and missing terms of a model are added to it, so that they are no longer
    effects.
    """
    simulation, values = fit.simulation, fit.values.copy()
    names = [parameter.name for parameter in simulation.simulator.parameters]
    for effect in simulation.effects:
        if effect.site == Site.PARAMETER:
            index = names.index(effect.name.partition(":")[2])
            values[index] *= 1.0 + values[simulation.get_slice(effect)][0]
    parts = [(effect, _get_own_slice(simulation, effect)) for effect in simulation.effects]
    shape = {
        parameter.name: float(value)
        for effect, part in parts
        if effect.name == model_form.CORE_SHAPE
        for parameter, value in zip(simulation.parameters[part], values[part], strict=True)
    }
    found = [
        _make_effect_spec(effect, simulation.parameters[part], values[part])
        for effect, part in parts
        if effect.site != Site.PARAMETER and effect.name != model_form.CORE_SHAPE
    ]
    signals = (record.input_names, record.output_name)
    return _make_extended_spec(
        simulation.simulator, values[: len(names)], found, simulation.context, *signals, shape
    ).model_dump(mode="json", by_alias=True)


def _get_own_slice(simulation: ExtendedSimulator, effect: Effect) -> slice:
    """Return the slice of an effect without its last values, the initial states of further recordings."""
    part = simulation.get_slice(effect)
    return slice(part.start, part.stop - int(np.count_nonzero(simulation.is_copy[part])))


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
                found.append(_make_effect_spec(effect, parameters, values[start : start + len(parameters)]))
                start += len(parameters)
            return _make_extended_spec(
                simulator.simulator, values[:inner_size], found, simulator.scales, inputs, output, shape
            )
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
            order = simulator.denominator.size
            coefficients = tuple(map(float, values))
            return LinearSpec(
                kind="linear",
                order=order,
                delay=simulator.delay,
                numerator=coefficients[: order + 1],
                denominator=coefficients[order + 1 : 2 * order + 1],
                level=coefficients[2 * order + 1],
                reference_input=simulator.reference_input,
            )
        case PythonFunctionSimulator():
            path, _, function = simulator.source.rpartition(":")
            return ProgramSpec(kind="python", path=path, function=function, parameters=named)
    raise AssertionError(simulator)


def _make_extended_spec(
    simulator: Simulator,
    values: Signal,
    effects: Sequence[EffectSpec],
    scales: SimulationContext,
    inputs: tuple[str, ...],
    output: str,
    shape: Mapping[str, float] | None = None,
) -> LocalExtendedSpec:
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
        ),
    )


def _find_start(simulator: Simulator, values: Signal) -> dict[str, float]:
    """Return the states of equations at the first sample by name; empty for other simulators."""
    core = simulator
    while isinstance(core, SavedExtension | ResampledSimulator | OutputEquation):
        core = core.simulator
    if not isinstance(core, OdeSimulator) or isinstance(core, FmuSimulator):
        return {}
    prefix = "initial "
    return dict(core.initial) | {
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


def _make_effect_spec(effect: Effect, parameters: Sequence[Parameter], values: Signal) -> EffectSpec:
    return EffectSpec(
        name=effect.name,
        site=str(effect.site),
        parameters={
            parameter.name: ValueSpec(value=float(value), unit=parameter.unit)
            for parameter, value in zip(parameters, values, strict=True)
        },
    )
