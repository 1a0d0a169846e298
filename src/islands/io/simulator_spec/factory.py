"""Simulations made of what is asked for."""

import json
import runpy
from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.discrepancy.calibration.preparation import estimation_part, make_context
from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.interfaces.context import ForceCoordinate, SimulationContext
from islands.discrepancy.interfaces.effect import Effect
from islands.discrepancy.interfaces.simulator import Simulator
from islands.discrepancy.simulators.bouc_wen_piezo import BoucWenPiezoSimulator
from islands.discrepancy.simulators.cascaded_tanks import make_cascaded_tanks
from islands.discrepancy.simulators.extended import ExtendedSimulator
from islands.discrepancy.simulators.intersample import InterSample, ResampledSimulator
from islands.discrepancy.simulators.linear import LinearSimulator, estimate_linear
from islands.discrepancy.simulators.narx import NarxSimulator
from islands.discrepancy.simulators.python_function import PythonFunctionSimulator
from islands.discrepancy.simulators.recorded_output import RecordedOutput
from islands.discrepancy.simulators.rigid_axis import make_rigid_axis
from islands.discrepancy.simulators.saved_extension import SavedExtension
from islands.discrepancy.simulators.second_order import make_second_order
from islands.errors import ModelError, RecordError, SettingsError, lookup
from islands.io.models import model_from_json
from islands.io.simulator_spec.specification import (
    PARAMETERS,
    ColumnSpec,
    ExtendedSpec,
    LinearSpec,
    LocalExtendedSpec,
    LocalSpec,
    ModelSpec,
    PhysicalSpec,
    ProgramSpec,
    SimulationSpec,
    parse_spec,
)
from islands.systems.bouc_wen import BoucWenPiezo

#: The fewest samples that where a motion begins, and constants, are estimated from.
FEWEST = 20


def make_simulator(
    asked: str | SimulationSpec | LocalSpec,
    record: Dataset,
    columns: Mapping[str, Any] | None = None,
) -> Simulator:
    """Return the simulation that is asked for.

    Parameters
    ----------
    asked : str or spec
        As on the command line, or as over REST.
    record : Dataset
        What it will be held against.
    columns : mapping, optional
        Columns of the record's file that a simulation may be, by name: ``(samples,)`` each.

    Raises
    ------
    SettingsError, ModelError
        It asks for nothing that there is.
    """
    found = parse_spec(asked) if isinstance(asked, str) else asked
    match found:
        case PhysicalSpec(kind=kind, parameters=parameters):
            return PHYSICAL[kind](parameters, record)
        case LinearSpec(numerator=None):
            return estimate_linear(found.order, found.delay, _estimable(record))
        case LinearSpec():
            return LinearSimulator(
                *(np.array(found.numerator), np.array(found.denominator), found.level, found.delay),
                record.output_unit or "1",
            )
        case ProgramSpec(path=path, function=function, parameters=parameters):
            return _program(path, function, parameters)
        case ModelSpec(model=document, name=name):
            return _model(document, name, record)
        case ExtendedSpec():
            return _extension(found, record, columns or {})
        case ColumnSpec(column=name):
            return _column(name, lookup(columns or {}, name, "column"), record)


def simulate_spec(
    asked: str | Mapping[str, Any] | SimulationSpec | LocalSpec,
    record: Dataset,
    columns: Mapping[str, Any] | None = None,
) -> NDArray[np.float64]:
    """Simulate a record with what is asked for; an extended simulation may be given as its document.

    What a simulation does not say, such as the state at the first sample, is taken from the record's output.

    Returns
    -------
    ndarray, shape (samples,)
    """
    if isinstance(asked, Mapping):
        asked = LocalExtendedSpec.model_validate(asked)
    simulator = make_simulator(asked, record, columns)
    alone = ExtendedSimulator(simulator, (), make_context(record, simulator, record.samples))
    begins = [place for place, parameter in enumerate(alone.parameters) if parameter.initial]
    if not begins:
        return alone.simulate(alone.nominal)
    # The state at the first sample belongs to this record: it is fitted, and nothing else.
    scales = alone.scales[begins]

    def at(steps: NDArray[np.float64]) -> NDArray[np.float64]:
        values = alone.nominal
        values[begins] += scales * steps
        return alone.simulate(np.clip(values, *alone.bounds))

    size = float(np.std(record.y)) or 1.0
    best = scipy.optimize.least_squares(
        lambda steps: np.nan_to_num((at(steps) - record.y) / size, nan=1e6),
        np.zeros(len(begins)),
        method="lm",
        diff_step=1e-4,
    )
    return at(best.x)


def _extension(document: ExtendedSpec, record: Dataset, columns: Mapping[str, Any]) -> Simulator:
    simulator = make_simulator(document.core, record, columns)
    solved: Simulator = simulator
    if (document.hold, document.times) != ("first-order", 1):
        solved = ResampledSimulator(simulator, InterSample(document.hold), document.times)
    known = {**CATALOGUE, **{effect.name: effect for effect in simulator.state_effects}}
    given, frame = document.scales, document.scales.frame
    scales = SimulationContext(
        u=np.ascontiguousarray(record.u[:, 0]),
        dt=record.dt,
        channels={},
        units=dict(zip(record.input_names[1:], record.input_units[1:], strict=True)),
        input_peak=given.input_peak,
        output_peak=given.output_peak,
        input_unit=record.input_units[0] or "1",
        output_unit=record.output_unit or "1",
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
    added: list[Effect] = []
    values: list[float] = []
    for each in document.effects:
        if each.name not in known:
            raise ModelError(
                f"this version of islands knows no effect {each.name!r} of {simulator.name}: diagnose again"
            )
        effect = known[each.name]
        names = [parameter.name for parameter in effect.parameters(scales)]
        if missing := [name for name in names if name not in each.parameters]:
            raise ModelError(f"effect {each.name} has no value for {', '.join(missing)}: diagnose again")
        added.append(effect)
        values += [each.parameters[name].value for name in names]
    return SavedExtension(solved, tuple(added), np.array(values), scales)


def _column(name: str, found: Any, record: Dataset) -> Simulator:
    output = np.asarray(found, dtype=np.float64)
    if output.shape != record.y.shape:
        raise RecordError(
            f"column {name} has the shape {output.shape}, the measured output {record.y.shape}: give a "
            "simulation of the same samples"
        )
    if np.isnan(output).any():
        raise RecordError(f"column {name} has gaps: simulate all samples, or select rows without any")
    return RecordedOutput(name, output)


def _piezo(given: Mapping[str, float], _record: Dataset) -> Simulator:
    return BoucWenPiezoSimulator(replace(BoucWenPiezo(), **_known(given, "bouc-wen-piezo")))


def _second_order(given: Mapping[str, float], record: Dataset) -> Simulator:
    return make_second_order(_known(given, "second-order"), _estimable(record))


def _axis(given: Mapping[str, float], record: Dataset) -> Simulator:
    known = _positive(_known(given, "rigid-axis"), "c", "F")
    return make_rigid_axis(known, record, _estimable(record).samples)


def _tanks(given: Mapping[str, float], record: Dataset) -> Simulator:
    return make_cascaded_tanks(_positive(_known(given, "cascaded-tanks")), _estimable(record))


def _estimable(record: Dataset) -> Dataset:
    """Return what estimation may see of a record, once it is known that it tells something."""
    if record.samples < FEWEST:
        raise RecordError(
            f"the record has {record.samples} samples, and a simulation that begins where it does takes "
            f"{FEWEST} at least: give a longer one"
        )
    if np.isnan(record.y).any():
        raise RecordError("the measured output has gaps: repair them, or select rows without any")
    return estimation_part(record)


def _program(path: str, name: str, given: Mapping[str, float]) -> Simulator:
    """Run a file of the user's own and take a function out of it."""
    try:
        function = runpy.run_path(path).get(name)
    except (Exception, SystemExit) as error:
        raise SettingsError(f"{path} cannot be run: {type(error).__name__}: {error}") from error
    if not callable(function):
        raise SettingsError(f"{path} has no function {name!r}: write python:FILE.py:FUNCTION")
    return PythonFunctionSimulator(function, f"{path}:{name}", given)


def _model(document: Mapping[str, Any], name: str, record: Dataset) -> Simulator:
    model = model_from_json(json.dumps(document), name)
    if model.dt is not None and abs(model.dt - record.dt) > 1e-3 * record.dt:
        raise SettingsError(
            f"{name} was identified at {model.dt:g} s, the record is sampled at {record.dt:g} s: give a "
            "model and a record of one sampling time"
        )
    if model.theta is None:
        raise ModelError(f"{name} has no parameters: estimate them first")
    return NarxSimulator(model, name, record.y[: model.maximum_lag])


def _known(given: Mapping[str, float], kind: str) -> Mapping[str, float]:
    if unknown := given.keys() - set(PARAMETERS[kind]):
        known = ", ".join(PARAMETERS[kind])
        raise SettingsError(f"there is no parameter {', '.join(sorted(unknown))}: the parameters are {known}")
    return given


def _positive(given: Mapping[str, float], *perhaps_zero: str) -> Mapping[str, float]:
    for name, value in given.items():
        if value < 0.0 or (value == 0.0 and name not in perhaps_zero):
            raise SettingsError(f"{name} = {value:g} is no such system's: give a positive value")
    return given


#: What makes a physical system of the parameters that are given; a new one is one entry here.
PHYSICAL: Mapping[str, Callable[[Mapping[str, float], Dataset], Simulator]] = MappingProxyType(
    {
        "bouc-wen-piezo": _piezo,
        "second-order": _second_order,
        "rigid-axis": _axis,
        "cascaded-tanks": _tanks,
    }
)
