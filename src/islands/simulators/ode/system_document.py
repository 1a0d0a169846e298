"""Systems as documents of numbers and texts, as in a TOML file, and the checks of their content."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf, isfinite
from typing import Any

from islands.errors import ModelError, suggest
from islands.expressions.parsing import parse_expression
from islands.expressions.printing import render
from islands.expressions.tree import Symbol, find_symbols
from islands.simulators.ode.equation_parser import Equation, check_name, parse_equations
from islands.simulators.ode.system import (
    EFFECT_VALUE,
    OUTPUT,
    OdeEffect,
    OdeForce,
    OdeParameter,
    OdeState,
    OdeSystem,
    check_symbols,
    sort_variables,
)

#: Largest number of states.
MAX_STATES = 40

#: Largest number of integration steps per sample.
MAX_STEPS = 256

#: Largest number of variables.
MAX_VARIABLES = 200

#: Largest number of parameters.
MAX_PARAMETERS = 100

#: Names in the equation: the input, and the output of the simulation.
INPUT, SIMULATED = "u", "y_sim"

#: Their meaning, for texts that contain the equation.
SYMBOL_MEANINGS = f"{SIMULATED} is the simulated output, {INPUT} the input"


def make_system(document: Mapping[str, Any]) -> OdeSystem:
    """Make a system of a document with the fields of a TOML file. The caller checks the types of its values.

    Raises
    ------
    ModelError
        The equations, their names or their values are invalid. The message quotes the line.
    """
    equations = parse_equations(document["equations"])
    declared = document.get("states", {})
    names = [equation.target for equation in equations if equation.is_derivative]
    for name in declared:
        if name not in names:
            raise ModelError(
                f"[states] {name}: there is no equation d{name}/dt = ...: add it, or remove the state"
                f"{suggest(name, names)}"
            )
    parameters = tuple(make_parameter(name, entry) for name, entry in document.get("parameters", {}).items())
    system = OdeSystem(
        name=document["name"],
        summary=document.get("summary", ""),
        input=document["input"],
        channels=tuple(document.get("channels", ())),
        derivatives=tuple(
            (equation.target, equation.expression) for equation in equations if equation.is_derivative
        ),
        variables=tuple(
            (equation.target, equation.expression) for equation in equations if not equation.is_derivative
        ),
        output=parse_expression(document["output"], f"output, {document['output']!r}"),
        parameters=parameters,
        states=tuple(_make_state(name, declared.get(name, {})) for name in names),
        force=make_force(document["input"], document.get("force")),
        input_unit=document.get("input_unit", ""),
        output_unit=document.get("output_unit", ""),
        steps=document.get("steps", 0),
        gain=document.get("gain", ""),
        shooting=document.get("shooting", 0.0),
        contains=tuple(document.get("contains", ())),
        effects=tuple(_make_effect(name, entry) for name, entry in document.get("effects", {}).items()),
    )
    _check_sizes(system)
    _check_unique(system, equations)
    for equation in equations:
        check_symbols(equation.expression, system, equation.place)
    check_symbols(system.output, system, f"output, {document['output']!r}")
    if system.force is not None:
        check_symbols(system.force.drive, system, "[force] drive")
        for name in filter(None, (system.force.coordinate, system.force.rate)):
            check_symbols(Symbol(name), system, "[force]")
    sort_variables(system)
    _check_used(system)
    _check_effects(system)
    return system


def make_parameter(name: str, entry: Any) -> OdeParameter:
    """Make a parameter of its value or of a document; raise `ModelError` if it is invalid."""
    found = OdeParameter(name, **(entry if isinstance(entry, Mapping) else {"value": entry}))
    place = f"[parameters] {name}"
    lower, upper = (
        (-inf if found.lower is None else found.lower),
        (inf if found.upper is None else found.upper),
    )
    if not lower <= found.value <= upper or lower == upper:
        raise ModelError(f"{place}: the value {found.value:g} is not between lower and upper")
    if found.value == 0.0 and not found.fixed and not isfinite(upper - lower):
        raise ModelError(f"{place}: give lower and upper, since the value 0 does not tell a typical size")
    if found.tolerance is not None and (found.fixed or found.value == 0.0 or not 0.0 < found.tolerance < 1.0):
        raise ModelError(
            f"{place}: a tolerance is a fraction of a value that is not 0 and not fixed, such as 0.02: "
            "correct it or leave it out"
        )
    return found


def _make_state(name: str, entry: Mapping[str, Any]) -> OdeState:
    found = OdeState(name, **entry)
    ordered = found.initial is None or found.lower <= found.initial <= found.upper
    if not found.lower < found.upper or not ordered:
        raise ModelError(f"[states] {name}: lower, initial and upper have to be in this order")
    if found.fixed and found.initial is None:
        raise ModelError(f"[states] {name}: a fixed state needs a value: give initial")
    return found


def make_force(driving: str, entry: Mapping[str, Any] | None) -> OdeForce | None:
    """Make the coordinate of forces; raise `ModelError` if it is invalid. ``driving`` is the input."""
    if not entry:
        return None
    drive = entry.get("drive") or driving
    unit = entry.get("unit", "")
    if drive != driving and not unit:
        raise ModelError("[force]: give the unit of a force, since its drive is not the input")
    if bool(entry.get("rate")) == (entry["coordinate"] == driving):
        raise ModelError(
            "[force]: give coordinate and rate, or the input as the coordinate and no rate, if forces are "
            "added to the output"
        )
    return OdeForce(
        entry["coordinate"], entry.get("rate", ""), unit, parse_expression(drive, f"[force] drive, {drive!r}")
    )


def _make_effect(name: str, entry: Mapping[str, Any]) -> OdeEffect:
    place = f"[effects] {name}"
    if bool(entry.get("equation")) != bool(entry.get("term")):
        raise ModelError(f"{place}: give equation and term, or neither of them for a limit of a state")
    if not entry.get("term"):
        return OdeEffect(name)
    return OdeEffect(name, entry["equation"], parse_expression(entry["term"], f"{place}, {entry['term']!r}"))


def _check_sizes(system: OdeSystem) -> None:
    for count, most, what in (
        (len(system.states), MAX_STATES, "states"),
        (len(system.variables), MAX_VARIABLES, "variables"),
        (len(system.parameters), MAX_PARAMETERS, "parameters"),
    ):
        if count > most:
            raise ModelError(f"the equations have {count} {what}, and {most} is the most")


def _check_unique(system: OdeSystem, equations: Sequence[Equation]) -> None:
    """Check that each name is legal and has one meaning."""
    places = {equation.target: equation.place for equation in equations}
    for name in (*system.signals, *(parameter.name for parameter in system.parameters)):
        check_name(name, f"name {name!r}")
    counted = Counter(
        [
            *system.signals,
            *(equation.target for equation in equations),
            *(parameter.name for parameter in system.parameters),
        ]
    )
    for name, count in counted.items():
        if count > 1:
            raise ModelError(
                f"{places.get(name, 'names')}: {name!r} is defined {count} times (equations, "
                "parameters, input, channels): remove or rename one"
            )
    if OUTPUT in counted:
        raise ModelError(f"{OUTPUT!r} already has a meaning: take another name")


def _check_used(system: OdeSystem) -> None:
    """Check that the output can depend on the parameters: one that no equation reads cannot be calibrated."""
    read = {name for _, each in (*system.derivatives, *system.variables) for name in find_symbols(each)}
    read |= set(find_symbols(system.output))
    unused = [parameter.name for parameter in system.parameters if parameter.name not in read]
    if unused:
        raise ModelError(
            f"no equation reads the parameter {', '.join(unused)}: correct its name or remove it"
        )
    if system.input not in read:
        raise ModelError(f"no equation reads the input {system.input}: correct its name")


def _check_effects(system: OdeSystem) -> None:
    """Check effects, the parameter that is the gain, and the states that others spill into."""
    names = [each.name for each in system.states]
    parameters = [parameter.name for parameter in system.parameters]
    if system.gain and system.gain not in parameters:
        raise ModelError(
            f"gain: there is no parameter {system.gain!r}: take one of [parameters]"
            f"{suggest(system.gain, parameters)}"
        )
    for state in system.states:
        if state.spills_into and (state.spills_into not in names or state.spills_into == state.name):
            raise ModelError(
                f"[states] {state.name}: spills_into has to be another state"
                f"{suggest(state.spills_into, names)}"
            )
    extended = replace(system, parameters=(*system.parameters, OdeParameter(EFFECT_VALUE, 0.0)))
    for effect in system.effects:
        place = f"[effects] {effect.name}"
        if effect.term is None:
            if effect.name.partition(":")[2] not in names:
                raise ModelError(f"{place}: give equation and term, or the name of a state after the colon")
            continue
        if EFFECT_VALUE not in find_symbols(effect.term) or EFFECT_VALUE in system.find_names():
            raise ModelError(
                f"{place}: the term has to contain {EFFECT_VALUE}, and nothing else may have that name"
            )
        check_symbols(effect.term, extended, place)
        extended.with_term(effect.equation, effect.term)


def describe_system(system: OdeSystem) -> dict[str, Any]:
    """Return the document of a system, from which `make_system` makes the same system."""
    document: dict[str, Any] = {
        "name": system.name,
        "summary": system.summary,
        "input": system.input,
        "channels": list(system.channels),
        "equations": render_equations(system),
        "output": render(system.output),
        "parameters": {
            each.name: _given(each, OdeParameter(each.name, each.value)) for each in system.parameters
        },
        "states": {state.name: _given(state, OdeState(state.name)) for state in system.states},
        "input_unit": system.input_unit,
        "output_unit": system.output_unit,
        "steps": system.steps,
        "gain": system.gain,
        "shooting": system.shooting,
        "contains": list(system.contains),
        "effects": {effect.name: _describe_effect(effect) for effect in system.effects},
    }
    for parameter in system.parameters:
        document["parameters"][parameter.name]["value"] = parameter.value
    if system.force is not None:
        document["force"] = {
            "coordinate": system.force.coordinate,
            "rate": system.force.rate,
            "unit": system.force.unit,
            "drive": render(system.force.drive),
        }
    return {
        key: value for key, value in document.items() if value not in ("", [], {}, 0) or key == "equations"
    }


def _describe_effect(effect: OdeEffect) -> dict[str, str]:
    if effect.term is None:
        return {}
    return {"equation": effect.equation, "term": render(effect.term)}


def _given(entry: OdeParameter | OdeState, default: OdeParameter | OdeState) -> dict[str, Any]:
    return {
        name: getattr(entry, name)
        for name in entry.__dataclass_fields__
        if name != "name" and getattr(entry, name) != getattr(default, name)
    }


def render_equations(system: OdeSystem) -> str:
    """Write the equations of a system, one per line."""

    def lines() -> Iterator[str]:
        for name, right in system.derivatives:
            yield f"d{name}/dt = {render(right)}"
        for name, right in system.variables:
            yield f"{name} = {render(right)}"

    return "\n".join(lines()) + "\n"


def make_output_system(
    name: str, equation: str = SIMULATED, parameters: Mapping[str, Any] | None = None
) -> OdeSystem:
    """Make the equation of the output of a simulation.

    Parameters
    ----------
    name : str
        Name of the simulation.
    equation : str
        Output as an expression of that of the simulation ``y_sim``, its input ``u``, the time and parameters.
    parameters : mapping, optional
        Values or documents of the parameters by name.

    Raises
    ------
    ModelError
        The equation or a parameter is invalid.
    """
    system = OdeSystem(
        name=name,
        input=INPUT,
        derivatives=(),
        variables=(),
        output=parse_expression(equation),
        parameters=tuple(make_parameter(*each) for each in (parameters or {}).items()),
        states=(),
        simulated=(SIMULATED,),
    )
    check_symbols(system.output, system, f"output, {equation!r}")
    return system
