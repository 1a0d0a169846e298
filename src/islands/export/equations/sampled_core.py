"""Simulator in the document of an extended simulation: a system of equations, or one in discrete time."""

import json
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from islands.errors import ModelError
from islands.export.equations.extended_system import NamedValue, SampledCore
from islands.expressions.primitives import ADD, MUL, SUB
from islands.expressions.tree import Apply, Constant, Expression, Symbol
from islands.models.measured_signals import measured_block
from islands.persistence.models import model_from_json
from islands.records.channel_names import parse_channel_name
from islands.simulators.linear import LinearSimulator
from islands.simulators.ode.equation_parser import FORCE
from islands.simulators.ode.simulator import fill_units
from islands.simulators.ode.system import OdeSystem
from islands.simulators.ode.system_document import SIMULATED, make_output_system
from islands.simulators.specification.equations import OdeSpec, read_built_in
from islands.simulators.specification.table import (
    SIMULATORS,
    ColumnSpec,
    ExtendedSpec,
    LinearSpec,
    ModelSpec,
    PhysicalSpec,
)

#: Names of the columns that a program reads besides the input: the measured and a simulated output.
MEASURED, RECORDED = "y_measured", "simulated"


def refuse(what: str) -> ModelError:
    """Return the error for what has no program."""
    return ModelError(f"{what} cannot be written in C or MATLAB: take the format plain, python or json")


def read_system(spec: ExtendedSpec) -> OdeSystem:
    """Return the equations of the simulator in a document, with the units in the names of its columns.

    Raises
    ------
    ModelError
        It is no system of equations, or its parameters are estimated from a record.
    """
    core = spec.core
    if isinstance(core, OdeSpec):
        return core.make_system()
    if not isinstance(core, PhysicalSpec):
        raise refuse(f"the simulation {core.kind}")
    entry = SIMULATORS[core.kind]
    if entry.estimator and (missing := entry.parameters.keys() - core.parameters.keys()):
        raise refuse(
            f"the simulation {core.kind}, whose parameters {', '.join(sorted(missing))} are estimated from a "
            "record,"
        )
    system = read_built_in(core.kind).with_values(core.parameters)
    return fill_units(
        replace(system, steps=core.steps),
        parse_channel_name(spec.inputs[0]).unit,
        parse_channel_name(spec.output).unit,
    )


def drop_force(system: OdeSystem) -> OdeSystem:
    """Return a system without the sum of forces where no law contributes to it."""

    def drop(expression: Expression) -> Expression:
        match expression:
            case Symbol(name) if name == FORCE:
                return Constant(0.0)
            case Apply(primitive, arguments):
                first, *others = (drop(each) for each in arguments)
                if primitive in (ADD, SUB) and others == [Constant(0.0)] and arguments[1] == Symbol(FORCE):
                    return first
                return Apply(primitive, (first, *others))
        return expression

    return replace(
        system,
        derivatives=tuple((name, drop(right)) for name, right in system.derivatives),
        variables=tuple((name, drop(right)) for name, right in system.variables),
        output=drop(system.output),
    )


def read_core(spec: ExtendedSpec) -> SampledCore | None:
    """Return the simulation in discrete time of a document; None if it has another one.

    Raises
    ------
    ModelError
        The coefficients are estimated from a record.
    """
    match spec.core:
        case LinearSpec():
            return _make_filter(spec.core)
        case ModelSpec():
            return _make_model(spec.core, spec.output, spec.start)
        case ColumnSpec(column=name):
            return SampledCore("a column of the record", columns={RECORDED: name})
    return None


def read_output_system(spec: ExtendedSpec) -> OdeSystem:
    """Return the equation of the output in a document; the output itself if it has none."""
    given = spec.output_equation
    system = make_output_system(spec.core.kind) if given is None else given.make_system(spec.core.kind)
    return replace(system, channels=(SIMULATED,), simulated=())


def _make_model(spec: ModelSpec, output: str, states: Mapping[str, float]) -> SampledCore:
    block = measured_block(model_from_json(json.dumps(spec.model), spec.name))
    start = "the operating point" if block.is_state_space else f"{block.maximum_lag} measured outputs"
    if states:
        block = block.start_at({f"initial {name}": value for name, value in states.items()})
        start = ", ".join(f"{name} = {value:.6g}" for name, value in states.items())
    return SampledCore(
        f"free run of the model {'; '.join(block.texts)} from {start}",
        block=block,
        columns={MEASURED: output},
    )


def _make_filter(spec: LinearSpec) -> SampledCore:
    """Return a linear filter in the transposed direct form II, which starts at rest."""
    if spec.numerator is None or spec.reference_input is None:
        raise refuse("a linear simulation whose coefficients or reference are estimated from a record")
    linear = LinearSimulator(
        *(np.array(spec.numerator), np.array(spec.denominator), spec.level, spec.reference_input, spec.delay),
        "1",
    )
    given = {
        **{f"b{lag}": value for lag, value in enumerate(spec.numerator)},
        **{f"a{lag}": value for lag, value in enumerate(spec.denominator, start=1)},
        "level": spec.level,
        "reference": spec.reference_input,
    }
    x, y = Apply(SUB, (Symbol("x"), _name("reference"))), Symbol("y")
    memory = [f"z{place}" for place in range(1, spec.order + 1)]
    at_rest = map(Constant, linear.state_at_rest.tolist())
    after = []
    for lag, name in enumerate(memory, start=1):
        fed = _add(_multiply(f"b{lag}", x), _multiply(f"a{lag}", Apply(SUB, (y, _name("level")))))
        after.append((name, fed if lag == spec.order else _add(fed, Symbol(memory[lag]))))
    through = _multiply("b0", x)
    return SampledCore(
        f"linear filter of order {spec.order}; the input acts {spec.delay} samples late",
        before=tuple(
            (name, _add(_name(f"state {place}"), Apply(MUL, (each, x))))
            for place, (name, each) in enumerate(zip(memory, at_rest, strict=True), start=1)
        ),
        output=_add(_name("level"), _add(through, Symbol(memory[0])) if memory else through),
        after=tuple(after),
        delay=spec.delay,
        values={f"linear {name}": NamedValue(value) for name, value in given.items()},
        start={f"linear state {place}": NamedValue(0.0) for place in range(1, spec.order + 1)},
    )


def _name(name: str) -> Symbol:
    return Symbol(f"linear {name}")


def _multiply(name: str, factor: Expression) -> Expression:
    return Apply(MUL, (_name(name), factor))


def _add(first: Expression, second: Expression) -> Expression:
    return Apply(ADD, (first, second))
