"""Extended simulations as documents: ``extended.json``, which is read as a simulation again."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.levenberg_marquardt import CalibrationResult
from islands.discrepancy.effects import model_form
from islands.discrepancy.interfaces.context import ForceCoordinate, Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.intersample import InterSample, ResampledSimulator
from islands.discrepancy.simulators.linear import LinearSimulator
from islands.discrepancy.simulators.narx import NarxSimulator
from islands.discrepancy.simulators.python_function import PythonFunctionSimulator
from islands.discrepancy.simulators.recorded_output import RecordedOutput
from islands.discrepancy.simulators.saved_extension import SavedExtension
from islands.io.models import model_json
from islands.io.simulator_spec.spec_base import EffectSpec, FrameSpec, ScalesSpec, ValueSpec
from islands.io.simulator_spec.specification import (
    ColumnSpec,
    LinearSpec,
    LocalExtendedSpec,
    LocalSpec,
    ModelSpec,
    PhysicalSpec,
    ProgramSpec,
)


def extended_json(fit: CalibrationResult, record: Dataset) -> str:
    """Write a simulation with its effects, and the values of both."""
    return json.dumps(extended_document(fit, record), indent=2, allow_nan=False) + "\n"


def extended_document(fit: CalibrationResult, record: Dataset) -> dict[str, Any]:
    """Describe a simulation with its effects, and the values of both.

    A parameter that was found to be wrong is put right, and terms that a model lacks are written into it:
    they are no effects any more.
    """
    simulation, values = fit.simulation, fit.values.copy()
    names = [parameter.name for parameter in simulation.simulator.parameters]
    for effect in simulation.effects:
        if effect.site == Site.PARAMETER:
            place = names.index(effect.name.partition(":")[2])
            values[place] *= 1.0 + values[simulation.get_slice(effect)][0]
    parts = [(effect, simulation.get_slice(effect)) for effect in simulation.effects]
    shape = {
        parameter.name: float(value)
        for effect, part in parts
        if effect.name == model_form.CORE_SHAPE
        for parameter, value in zip(simulation.parameters[part], values[part], strict=True)
    }
    found = [
        _effect(effect, simulation.parameters[part], values[part])
        for effect, part in parts
        if effect.site != Site.PARAMETER and effect.name != model_form.CORE_SHAPE
    ]
    names_of = (record.input_names, record.output_name)
    return _extended(
        simulation.simulator, values[: len(names)], found, simulation.context, *names_of, shape
    ).model_dump(mode="json", by_alias=True)


def describe_extension(
    simulator: Simulator,
    values: Signal,
    inputs: tuple[str, ...],
    output: str,
    shape: Mapping[str, float] | None = None,
) -> LocalSpec:
    """Say how a core with values is asked for; ``shape`` is what an identified model in it lacks.

    What belongs to a record, the state at its first sample, is not said: another record begins elsewhere.
    """
    named = {
        parameter.name: float(value)
        for parameter, value in zip(simulator.parameters, values, strict=True)
        if not parameter.initial
    }
    match simulator:
        case SavedExtension():
            own, found, at = len(simulator.simulator.parameters), [], 0
            for effect in simulator.added:
                parameters = effect.parameters(simulator.scales)
                here = slice(own + at, own + at + len(parameters))
                found.append(_effect(effect, parameters, values[here]))
                at += len(parameters)
            return _extended(
                simulator.simulator, values[:own], found, simulator.scales, inputs, output, shape
            )
        case NarxSimulator():
            model = simulator.with_shape(values, shape) if shape else simulator.with_values(values)
            return ModelSpec(kind="model", model=json.loads(model_json(model)), name=simulator.name)
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
            )
        case PythonFunctionSimulator():
            path, _, function = simulator.source.rpartition(":")
            return ProgramSpec(kind="python", path=path, function=function, parameters=named)
    return PhysicalSpec(kind=simulator.name, parameters=named)


def _extended(
    simulator: Simulator,
    values: Signal,
    effects: Sequence[EffectSpec],
    scales: SimulationContext,
    inputs: tuple[str, ...],
    output: str,
    shape: Mapping[str, float] | None = None,
) -> LocalExtendedSpec:
    hold, times, inner = InterSample.FOH, 1, simulator
    if isinstance(simulator, ResampledSimulator):
        hold, times, inner = simulator.intersample, simulator.oversampling, simulator.simulator
    return LocalExtendedSpec(
        inputs=inputs,
        output=output,
        core=describe_extension(inner, values, inputs, output, shape),
        hold=hold.value,
        times=times,
        effects=tuple(effects),
        scales=ScalesSpec(
            dt=scales.dt,
            input_peak=scales.input_peak,
            output_peak=scales.output_peak,
            fitted_s=scales.fit_end_time,
            duration_s=scales.duration,
            frame=_frame(scales.force_coordinate),
        ),
    )


def _frame(coordinate: ForceCoordinate) -> FrameSpec:
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


def _effect(effect: Effect, parameters: Sequence[Parameter], values: Signal) -> EffectSpec:
    return EffectSpec(
        name=effect.name,
        site=str(effect.site),
        parameters={
            parameter.name: ValueSpec(value=float(value), unit=parameter.unit)
            for parameter, value in zip(parameters, values, strict=True)
        },
    )
