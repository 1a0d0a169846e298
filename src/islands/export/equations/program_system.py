"""System of equations in the document of an extended simulation, for a program."""

from dataclasses import replace

from islands.errors import ModelError
from islands.expressions.primitives import ADD, SUB
from islands.expressions.tree import Apply, Constant, Expression, Symbol
from islands.records.channel_names import parse_channel_name
from islands.simulators.ode.equation_parser import FORCE
from islands.simulators.ode.simulator import fill_units
from islands.simulators.ode.system import OdeSystem
from islands.simulators.specification.equations import OdeSpec, read_built_in
from islands.simulators.specification.table import SIMULATORS, ExtendedSpec, PhysicalSpec


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
