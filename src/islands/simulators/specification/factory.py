"""Factory of simulators: a specification and a record become a `Simulator`."""

import json
import runpy
from collections.abc import Mapping
from dataclasses import asdict, replace
from pkgutil import resolve_name
from typing import Any, TypeVar

import numpy as np

from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.effect import Effect
from islands.errors import (
    ModelError,
    RecordError,
    SettingsError,
    lookup,
    name_option,
    name_without_value,
    suggest,
)
from islands.models.narx import Model, measured_model
from islands.models.parametric import ParametricModel
from islands.models.protocol import DynamicModel, no_model_error
from islands.models.signal_statement import describe_values
from islands.persistence.models import model_from_json
from islands.records.compatibility import ColumnReference, match_record
from islands.records.dataset import Dataset, same_dt
from islands.records.magnitudes import check_magnitudes
from islands.records.masked_values import fill_masked
from islands.records.preprocessing_steps import NO_STEPS, PreprocessingSteps
from islands.records.segments import fill_gaps
from islands.records.split import estimation_part
from islands.simulators.extended import SavedExtension
from islands.simulators.external import PythonFunctionSimulator, RecordedOutput
from islands.simulators.fmu.instance import LOCAL_FMUS, FmuSource
from islands.simulators.fmu.simulator import make_fmu_simulator
from islands.simulators.identified import NarxSimulator, ParametricSimulator
from islands.simulators.interface import Simulator
from islands.simulators.intersample import InterSample, ResampledSimulator
from islands.simulators.linear import LinearSimulator, estimate_linear
from islands.simulators.ode.simulator import make_ode_simulator
from islands.simulators.ode.system_document import SIMULATED
from islands.simulators.output_equation import OutputEquation
from islands.simulators.specification.base import ParameterRange, SimulatorEntry, SpecModel
from islands.simulators.specification.code import FmuSpec, ProgramSpec
from islands.simulators.specification.description import read_scales
from islands.simulators.specification.equations import OdeSpec, read_built_in
from islands.simulators.specification.table import (
    SIMULATORS,
    ColumnSpec,
    ExtendedSpec,
    LinearSpec,
    LocalSpec,
    ModelSpec,
    PhysicalSpec,
    SimulationSpec,
    parse_spec,
)

#: Smallest number of samples from which parameters and the initial state are estimated.
MIN_SAMPLES = 20

M = TypeVar("M", bound=DynamicModel)


def make_simulator(
    spec: str | SimulationSpec | LocalSpec,
    record: Dataset,
    columns: Mapping[str, Any] | None = None,
    fmus: FmuSource = LOCAL_FMUS,
) -> Simulator:
    """Make a simulator from its specification.

    Parameters
    ----------
    spec : str or spec
        Text as on the command line, or a specification as over REST.
    record : Dataset
        Record that the simulation will be compared with.
    columns : mapping, optional
        Columns of the file of the record by name, each of shape (samples,); a column can be a simulation.
    fmus : FmuSource
        Describes and loads the FMU of a simulation.

    Raises
    ------
    SettingsError, ModelError
        The specification is invalid, or none.
    RecordError
        The record is not suitable for the simulator.
    """
    spec = parse_spec(spec) if isinstance(spec, str) else spec
    if not isinstance(spec, SpecModel):
        raise no_model_error(spec, ", or the name of a simulation")
    check_magnitudes(estimation_part(record), record)
    # Estimates and initial values need a complete output; the calibration leaves missing samples out.
    record = replace(record, y=fill_gaps(record.y))
    if isinstance(spec, ExtendedSpec):
        return _make_saved_extension(spec, record, columns or {}, fmus)
    if isinstance(spec, FmuSpec) and fmus != LOCAL_FMUS:
        return _make_fmu(spec, record, fmus)
    entry = SIMULATORS[spec.kind]
    if isinstance(spec, PhysicalSpec):
        _check_parameters(entry, spec.parameters)
        if entry.estimated:
            _check_estimable(record)
    simulator: Simulator = resolve_name(entry.factory)(spec, record, columns or {})
    return simulator


def _make_saved_extension(
    document: ExtendedSpec, record: Dataset, columns: Mapping[str, Any], fmus: FmuSource
) -> Simulator:
    # The channels may be others: effects find theirs by name.
    driving = ColumnReference(document.inputs[:1], document.output)
    match_record(driving, record.first_inputs(1), "the extended simulation", advance=False)
    simulator = make_simulator(document.core, record, columns, fmus)
    inner: Simulator = simulator
    if document.output_equation is not None:
        system = document.output_equation.make_system(simulator.name)
        inner = OutputEquation(inner, system, {SIMULATED: document.scales.output_peak})
    if (document.hold, document.times) != ("first-order", 1):
        inner = ResampledSimulator(inner, InterSample(document.hold), document.times)
    known = {**CATALOGUE, **{effect.name: effect for effect in simulator.state_effects}}
    units = record.input_units[0], record.output_unit
    scales = replace(
        read_scales(document.scales, np.ascontiguousarray(record.u[:, 0]), record.dt, units),
        channels=dict(zip(record.input_names[1:], np.ascontiguousarray(record.u.T[1:]), strict=True)),
        units=dict(zip(record.input_names[1:], record.input_units[1:], strict=True)),
    )
    added: list[Effect] = []
    values: list[float] = []
    for each in document.effects:
        if each.name not in known:
            raise ModelError(
                f"this version of islands has no effect {each.name!r} of {simulator.name}: diagnose again"
            )
        effect = known[each.name]
        names = [parameter.name for parameter in effect.parameters(scales)]
        if missing := [name for name in names if name not in each.parameters]:
            raise ModelError(f"effect {each.name} has no value for {', '.join(missing)}: diagnose again")
        added.append(effect)
        values += [each.parameters[name].value for name in names]
    return SavedExtension(inner, tuple(added), np.array(values), scales, document.tested)


def make_built_in(spec: PhysicalSpec, record: Dataset, _columns: Mapping[str, Any]) -> Simulator:
    """Make a built-in simulator; parameters that are not given have their nominal value or are estimated."""
    system, states = read_built_in(spec.kind).with_values(spec.parameters), {}
    if estimator := SIMULATORS[spec.kind].estimator:
        system, states = resolve_name(estimator)(system, spec.parameters, estimation_part(record))
    # An estimate may need several steps.
    return make_ode_simulator(replace(system, steps=spec.steps or system.steps), record, states)


def make_ode(spec: OdeSpec, record: Dataset, _columns: Mapping[str, Any]) -> Simulator:
    """Make a simulator of the equations in a specification."""
    return make_ode_simulator(spec.make_system(), record)


def make_linear(spec: LinearSpec, record: Dataset, _columns: Mapping[str, Any]) -> Simulator:
    """Make a linear model of the given coefficients, or estimate it from the estimation part of a record."""
    if spec.numerator is None:
        _check_estimable(record)
        return estimate_linear(spec.order, spec.delay, estimation_part(record))
    reference_input = float(record.u[0, 0]) if spec.reference_input is None else spec.reference_input
    return LinearSimulator(
        *(np.array(spec.numerator), np.array(spec.denominator), spec.level, reference_input, spec.delay),
        record.output_unit or "1",
    )


def make_recorded_output(spec: ColumnSpec, record: Dataset, columns: Mapping[str, Any]) -> Simulator:
    """Take a column of a record as the output of a simulation."""
    name = spec.column
    output = np.asarray(fill_masked(lookup(columns, name, "column")), dtype=np.float64)
    if output.shape != record.y.shape:
        raise RecordError(
            f"column {name} has the shape {output.shape}, the measured output {record.y.shape}: give a "
            "simulation of the same samples"
        )
    if np.isnan(output).any():
        raise RecordError(f"column {name} has gaps: simulate all samples, or select rows without any")
    return RecordedOutput(name, output)


def make_python_function(spec: ProgramSpec, _record: Dataset, _columns: Mapping[str, Any]) -> Simulator:
    """Run a Python file and make a simulator of one of its functions."""
    try:
        names = runpy.run_path(spec.path)
    except (Exception, SystemExit) as error:
        raise SettingsError(f"{spec.path} cannot be run: {type(error).__name__}: {error}") from error
    function = names.get(spec.function)
    if not callable(function):
        defined = [name for name, value in names.items() if callable(value)]
        raise SettingsError(
            f"{spec.path} has no function {spec.function!r}: write python:FILE.py:FUNCTION"
            f"{suggest(spec.function, defined)}"
        )
    return PythonFunctionSimulator(function, f"{spec.path}:{spec.function}", spec.parameters)


def make_fmu(spec: FmuSpec, record: Dataset, _columns: Mapping[str, Any]) -> Simulator:
    """Read an FMU and make a simulator of it and of the equations around it."""
    return _make_fmu(spec, record, LOCAL_FMUS)


def _make_fmu(spec: FmuSpec, record: Dataset, fmus: FmuSource) -> Simulator:
    model = spec.make_model(fmus.describe)
    return make_fmu_simulator(model, spec.make_system(model), record, fmus)


def make_identified_model(spec: ModelSpec, record: Dataset, _columns: Mapping[str, Any]) -> Simulator:
    """Make a simulator of the identified model in a specification."""
    return make_model_simulator(model_from_json(json.dumps(spec.model), spec.name), spec.name, record)


def make_model_simulator(model: DynamicModel, name: str, record: Dataset) -> Simulator:
    """Make a simulator of a model; its free run starts from the first measured outputs.

    Parameters
    ----------
    name : str
        Name of the model in reports and messages.

    Raises
    ------
    ModelError
        The model has no parameters, or several inputs.
    RecordError
        The first input of the record is not that of the model, the sampling times differ, or the model
        describes filtered samples or means that the record does not have.
    """
    if isinstance(model, Model) and model.theta is None:
        raise ModelError(f"{name} has no parameters: estimate them first")
    model = _read_as_recorded(model, name, record)
    simulator: Simulator
    match model:
        case Model():
            simulator = NarxSimulator(measured_model(model), name, fill_gaps(record.y))
        case ParametricModel():
            simulator = ParametricSimulator(model, name, replace(record, y=fill_gaps(record.y)))
        case _:
            raise ModelError(f"{name} is of the class {model.kind}, which cannot be diagnosed")
    # Further columns of the record are channels, which the model does not read.
    match_record(model, record.first_inputs(1), name, advance=False)
    return simulator


def _read_as_recorded(model: M, name: str, record: Dataset) -> M:
    """Return a model of the signals of a record, whose preprocessing has the offsets by which they differ.

    A diagnosis fits effects of the measured input between its samples, so it does not filter, decimate or
    average a record for its simulation.
    """
    expected, done = model.preprocessing, record.preprocessing
    if model.average > 1 and model.dt is not None and same_dt(model.dt, record.dt * model.average):
        raise RecordError(
            f"of {name}, {describe_values(model)}, and a diagnosis reads every sample: identify the model "
            f"with {name_option('average', 1)}"
        )
    if expected is None:
        return model
    if expected.rate_steps != (NO_STEPS if done is None else done.rate_steps):
        values = describe_values(replace(model, average=1)) or "each value is a sample as measured"
        raise RecordError(
            f"of {name}, {values}, and a diagnosis reads the record as it is: identify the model without "
            f"{name_without_value('lowpass')} and {name_without_value('decimate')}, or give "
            "islands.diagnose the record of islands.preprocess(record"
            f"{_list_steps(expected.rate_steps)})"
        )
    left = expected if done is None else expected.relative_to(done)
    return replace(model, preprocessing=left)


def _list_steps(steps: PreprocessingSteps) -> str:
    """Return steps as arguments of `islands.records.preprocessing.preprocess`."""
    given = {name: value for name, value in asdict(steps).items() if value != getattr(NO_STEPS, name)}
    return "".join(f", {name}={value!r}" for name, value in given.items())


def _check_parameters(entry: SimulatorEntry, given: Mapping[str, float]) -> None:
    if unknown := sorted(given.keys() - entry.parameters.keys()):
        known = ", ".join(entry.parameters)
        raise SettingsError(
            f"there is no parameter {', '.join(unknown)}: the parameters are {known}"
            f"{suggest(unknown[0], entry.parameters)}"
        )
    for name, value in given.items():
        allowed = entry.parameters[name]
        if allowed == ParameterRange.REAL or value > 0.0:
            continue
        if value < 0.0 or allowed == ParameterRange.POSITIVE:
            raise SettingsError(f"{name} = {value:g} is not possible for {entry.name}: give a positive value")


def _check_estimable(record: Dataset) -> None:
    """Raise `RecordError` if a record is too short for an estimate, or has no output."""
    if record.samples < MIN_SAMPLES:
        raise RecordError(
            f"the record has {record.samples} samples, and an estimate of the parameters requires "
            f"{MIN_SAMPLES} at least: give a longer one"
        )
    if np.isnan(record.y).any():  # the gaps of an output that has values are filled
        raise RecordError(
            "the output has no values, and an estimate of the parameters requires them: give them"
        )
