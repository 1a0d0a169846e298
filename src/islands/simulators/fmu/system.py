"""Equations around an FMU: the derivatives of its states and its output, and terms that they lack.

``fmu(x)`` is the derivative of the state x, or the value of the output y, that the FMU computes. The
equations of an FMU that nothing extends are ``dx/dt = fmu(x)`` and ``output = fmu(y)``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from islands.errors import ModelError, suggest
from islands.expressions.printing import render
from islands.expressions.tree import FMU, Apply, Expression, Symbol, find_symbols, walk
from islands.simulators.fmu.model import FmuModel
from islands.simulators.ode.equation_parser import FORCE, Equation, parse_equations
from islands.simulators.ode.system import (
    OUTPUT,
    OdeForce,
    OdeParameter,
    OdeState,
    OdeSystem,
    check_symbols,
    sort_variables,
)


def make_fmu_system(
    model: FmuModel,
    equations: str = "",
    coefficients: Sequence[OdeParameter] = (),
    force: OdeForce | None = None,
) -> OdeSystem:
    """Make the equations around an FMU.

    Parameters
    ----------
    equations : str
        Equations that differ from those of the FMU, one per line: ``dv/dt = fmu(v) - d*abs(v)*v`` for a
        state, ``output = fmu(y) + a*u`` for the output, or ``name = ...`` for a variable.
    coefficients : sequence of OdeParameter
        Parameters of the equations that are none of the FMU.
    force : OdeForce, optional
        Where force laws act; by default they are added to the output.

    Raises
    ------
    ModelError
        The equations are invalid. The message quotes the line.
    """
    symbols = model.symbols
    system = _make_plain_system(model, symbols)
    parsed = parse_equations(equations)
    for equation in parsed:
        _check_target(equation, system)
    given = {equation.target: equation.expression for equation in parsed}
    states = {name for name, _ in system.derivatives}
    system = replace(
        system,
        derivatives=tuple((name, given.get(name, right)) for name, right in system.derivatives),
        variables=tuple((name, right) for name, right in given.items() if name not in {*states, OUTPUT}),
        output=given.get(OUTPUT, system.output),
        parameters=(*system.parameters, *coefficients),
        force=force or system.force,
    )
    _check_names(system, parsed, coefficients)
    for equation in parsed:
        check_symbols(equation.expression, system, equation.place)
    for name in (system.force.coordinate, system.force.rate) if force and system.force else ():
        check_symbols(Symbol(name), system, "[force]")
    sort_variables(system)
    return system


def _make_plain_system(model: FmuModel, symbols: Mapping[str, str]) -> OdeSystem:
    states = [(symbols[each.variable.name], each.variable) for each in model.initial if each.place >= 0]
    driving, output = symbols[model.input.name], symbols[model.output.name]
    names = [name for name, _ in states]
    is_state = output in names
    return OdeSystem(
        name=model.description.name,
        input=driving,
        channels=tuple(symbols[channel.name] for channel in model.channels),
        derivatives=tuple((name, _call_fmu(name)) for name in names),
        variables=(),
        output=Symbol(output) if is_state else _call_fmu(output),
        parameters=tuple(
            OdeParameter(
                *(parameter.variable.name, parameter.value, parameter.variable.unit, parameter.tolerance),
                *(parameter.lower, parameter.upper, parameter.fixed),
            )
            for parameter in model.parameters
        ),
        states=tuple(OdeState(name, variable.unit) for name, variable in states),
        force=OdeForce(driving, "", "", Symbol(driving)),
        steps=model.steps,
        of_fmu=tuple(names) if is_state else (*names, output),
    )


def _call_fmu(name: str) -> Expression:
    return Apply(FMU, (Symbol(name),))


def _check_target(equation: Equation, system: OdeSystem) -> None:
    """Check that an equation is that of a state, of the output, or of a new variable."""
    states = [name for name, _ in system.derivatives]
    if equation.is_derivative and equation.target not in states:
        raise ModelError(
            f"{equation.place}: the FMU has no state {equation.target} whose initial value is estimated: "
            f"take one of {', '.join(states) or 'none, since it is a co-simulation or initial is empty'}"
            f"{suggest(equation.target, states)}"
        )
    if equation.target == OUTPUT and not equation.is_derivative:
        return
    for name in _find_fmu_values(equation.expression):
        if name in system.of_fmu and name not in states:
            raise ModelError(
                f"{equation.place}: {FMU.name}({name}) is possible in the equation of output only"
            )


def _find_fmu_values(expression: Expression) -> list[str]:
    calls = (part for part in walk(expression) if isinstance(part, Apply) and part.primitive == FMU)
    return [name for part in calls for name in map(render, part.arguments)]


def _check_names(
    system: OdeSystem, equations: Sequence[Equation], coefficients: Sequence[OdeParameter]
) -> None:
    """Check that every name has one meaning, and that the equations read the coefficients."""
    names = [*system.signals, *(name for name, _ in system.derivatives)]
    names += [name for name, _ in system.variables] + [parameter.name for parameter in system.parameters]
    targets = [equation.target for equation in equations]
    for name in (*targets, *names):
        if targets.count(name) > 1 or names.count(name) > 1:
            raise ModelError(f"the equations of {system.name}: {name!r} is defined twice: rename one")
    read = {name for equation in equations for name in find_symbols(equation.expression)}
    if system.force and system.force.rate and FORCE not in read:
        raise ModelError(
            f"no equation of {system.name} reads {FORCE}: subtract it in that of a state, as in "
            "dv/dt = fmu(v) - force/m"
        )
    if unused := [coefficient.name for coefficient in coefficients if coefficient.name not in read]:
        raise ModelError(f"no equation of {system.name} reads the coefficient {', '.join(unused)}: remove it")


def render_extension(model: FmuModel, system: OdeSystem) -> str:
    """Write the equations that differ from those of the FMU, one per line."""
    plain = _make_plain_system(model, model.symbols)
    own = dict(plain.derivatives)
    lines = [f"d{name}/dt = {render(right)}" for name, right in system.derivatives if right != own[name]]
    lines += [f"{name} = {render(right)}" for name, right in system.variables]
    lines += [f"{OUTPUT} = {render(system.output)}"] if system.output != plain.output else []
    return "".join(f"{line}\n" for line in lines)
