"""Effects in the equations of a system: offsets and limits of states, those that a file lists, force laws.

The kernel calls the function of a force law once for each lane. A law that is an expression becomes
instructions instead, which compute all lanes at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from math import inf

from islands.effects.baseline import input_offset
from islands.effects.catalogue import CATALOGUE
from islands.effects.interface.context import Signal, SimulationContext
from islands.effects.interface.effect import Effect, ForceLaw, Site
from islands.effects.nonlinearity import outflow_law, state_clip, state_range
from islands.effects.time_variation import GAIN_EFFECTS
from islands.errors import ModelError, suggest
from islands.expressions.parsing import parse_expression
from islands.expressions.primitives import ADD
from islands.expressions.tree import Apply, Expression, Symbol, substitute
from islands.kernels.mechanics import WIDTH
from islands.simulators.ode.equation_parser import FORCE
from islands.simulators.ode.system import EFFECT_VALUE, OdeEffect, OdeParameter, OdeSystem

#: Effects of the catalogue that a term can describe.
_SUPPORTED = frozenset(each.name for each in CATALOGUE.values() if each.site == Site.CORE) - GAIN_EFFECTS

#: Name of the state of a force law in its expressions.
LAW_STATE = "z"

#: Expression of a force law or of a map that is given as a text.
parse_law = cache(parse_expression)


def list_terms(system: OdeSystem) -> tuple[OdeEffect, ...]:
    """Return the effects that a system lists.

    By default these are an offset and a limit of each state that its equation does not merely define as a
    rate.
    """
    if system.effects:
        return system.effects
    return (
        *(OdeEffect(f"input-offset:{name}", name, Symbol(EFFECT_VALUE)) for name in system.balances),
        *(OdeEffect(f"state-clip:{name}") for name in system.balances),
    )


def find_effects(system: OdeSystem, sizes: Mapping[str, float]) -> tuple[frozenset[str], tuple[Effect, ...]]:
    """Return the names of the supported effects of the catalogue, and the effects on states.

    Parameters
    ----------
    sizes : mapping
        Largest absolute values of the states and of their derivatives (``dx/dt``).

    Raises
    ------
    ModelError
        A listed effect does not exist.
    """
    supported, effects = set(GAIN_EFFECTS), []
    states = {state.name: state for state in system.states}
    for term in list_terms(system):
        cause, _, place = term.name.partition(":")
        unit = states[place].unit if place in states else ""
        if term.name in _SUPPORTED:
            supported.add(term.name)
        elif cause == "input-offset" and place and term.term:
            # A listed offset has the unit of the input, which its term converts.
            own = () if system.effects else (f"{unit or '1'}/s", sizes[f"d{place}/dt"])
            effects.append(input_offset(place, *own))
        elif cause == "outflow-law" and place and term.term:
            effects.append(outflow_law(place))
        elif cause == "state-clip" and place in states and not term.term:
            # A listed limit has the size of the output: that of a state which is not measured is uncertain.
            size = 0.0 if system.effects else sizes[place]
            effects.append(state_clip(place, unit or "1", size, spills=bool(states[place].spills_into)))
        elif cause == "state-range" and place in states and not term.term:
            effects.append(state_range(place, unit or "1"))
        else:
            raise ModelError(
                f"[effects] {term.name}: there is no such effect: take input-offset:NAME, outflow-law:NAME, "
                f"{', '.join(sorted(_SUPPORTED))}, term with equation and term, or state-clip:STATE or "
                f"state-range:STATE without them"
                f"{suggest(cause, ('input-offset', 'outflow-law', 'state-clip', 'state-range', *_SUPPORTED))}"
            )
    return frozenset(supported), tuple(effects)


def find_limits(
    system: OdeSystem, effect_parameters: Mapping[str, float]
) -> tuple[dict[str, tuple[float, float]], dict[str, tuple[str, float]]]:
    """Return the limits of states, and the receivers and fractions of their overflow."""
    limits, spills = {}, {}
    for state in system.states:
        label = f"state-clip:{state.name}"
        level, own = effect_parameters.get(label, inf), f"state-range:{state.name}"
        lower = max(state.lower, -level, effect_parameters.get(f"{own} lower", -inf))
        upper = min(state.upper, level, effect_parameters.get(f"{own} upper", inf))
        if (lower, upper) != (-inf, inf):
            limits[state.name] = (lower, upper)
        if caught := effect_parameters.get(f"{label} caught", 0.0):
            spills[state.name] = (state.spills_into, caught)
    return limits, spills


def is_term(law: ForceLaw) -> bool:
    """Return whether a force law is an expression, so that it becomes a term of the equations."""
    return bool(law.equation and (law.state_equation or not law.state_derivative))


def extend_system(
    system: OdeSystem,
    active: Sequence[OdeEffect],
    factor: str = "",
    laws: Sequence[tuple[Mapping[str, Expression], ForceLaw]] = (),
    has_others: bool = False,
) -> OdeSystem:
    """Return a system with the terms of effects and force laws in its equations.

    Parameters
    ----------
    active : sequence of OdeEffect
        Effects with a term, whose values become parameters with their names.
    factor : str
        Signal that the gain is multiplied by; empty for none.
    laws : sequence of (mapping, ForceLaw)
        Force laws, with what is written for ``n0``, ``n1``, ... and for the state ``z`` of each.
    has_others : bool
        Whether there are other laws, which remain calls.
    """
    if factor:
        system = system.with_factor(system.gain, factor)
    for effect in active:
        system = system.with_effect(effect)
    return _add_force_laws(system, laws, has_others) if laws else system


def _add_force_laws(
    system: OdeSystem, laws: Sequence[tuple[Mapping[str, Expression], ForceLaw]], has_others: bool
) -> OdeSystem:
    assert system.force is not None
    forces: list[Expression] = [Symbol(FORCE)] if has_others else []
    parameters, states = list(system.parameters), []
    for given, law in laws:
        names = {"x": Symbol(system.force.coordinate), "v": Symbol(system.force.rate), **given}
        parameters += [
            OdeParameter(each.name, 0.0)
            for key, each in given.items()
            if key != LAW_STATE and isinstance(each, Symbol)
        ]
        forces.append(substitute(parse_law(law.equation), names))
        if law.state_equation:
            state = names[LAW_STATE]
            assert isinstance(state, Symbol)
            states.append((state.name, substitute(parse_law(law.state_equation), names)))
    total = forces[0]
    for force in forces[1:]:
        total = Apply(ADD, (total, force))

    def insert(right: Expression) -> Expression:
        return substitute(right, {FORCE: total})

    return replace(
        system,
        parameters=tuple(parameters),
        derivatives=(*((name, insert(right)) for name, right in system.derivatives), *states),
        variables=tuple((name, insert(right)) for name, right in system.variables),
        output=insert(system.output),
    )


def list_values(
    laws: Sequence[tuple[int, tuple[ForceLaw, Signal]]], context: SimulationContext
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the parameters and initial internal states of numbered laws, by their names in equations."""
    numbers, states = dict[str, float](), dict[str, float]()
    for number, (law, values) in laws:
        given = (*values, *law.constants(context))
        padded = [*map(float, given), *[0.0] * (WIDTH - len(given))]
        numbers |= {_name_number(number, index): value for index, value in enumerate(padded)}
        if law.state_equation:
            states[_name_state(number)] = law.get_initial_state(values)
    return numbers, states


def number_symbols(number: int) -> dict[str, Expression]:
    """Return the symbols that a numbered law has in equations, for `extend_system`."""
    numbers: dict[str, Expression] = {
        f"n{index}": Symbol(_name_number(number, index)) for index in range(WIDTH)
    }
    return {**numbers, LAW_STATE: Symbol(_name_state(number))}


# No name in equations has brackets.


def _name_number(number: int, index: int) -> str:
    return f"force[{number}] n{index}"


def _name_state(number: int) -> str:
    return f"force[{number}] z"
