"""Effects in the equations of a system: offsets and limits of states, and those that a file lists."""

from collections.abc import Mapping

from islands.discrepancy.effects import CATALOGUE
from islands.discrepancy.effects.baseline import input_offset
from islands.discrepancy.effects.nonlinearity import outflow_law, state_clip
from islands.discrepancy.effects.time_variation import GAIN_EFFECTS
from islands.discrepancy.interfaces.effect import Effect, Site
from islands.errors import ModelError
from islands.systems.ode.ode_expression import Symbol
from islands.systems.ode.ode_system import OdeSystem
from islands.systems.ode.system_parts import EFFECT_VALUE, OdeEffect

#: Effects of the catalogue that a term can describe.
_SUPPORTED = frozenset(each.name for each in CATALOGUE.values() if each.site == Site.CORE) - GAIN_EFFECTS


def list_terms(system: OdeSystem) -> tuple[OdeEffect, ...]:
    """Return the effects that a system lists.

    By default these are an offset and a limit of each state that its equation does not merely define as a
    rate.
    """
    if system.effects:
        return system.effects
    balances = [name for name, right in system.derivatives if not isinstance(right, Symbol)]
    return (
        *(OdeEffect(f"input-offset:{name}", name, Symbol(EFFECT_VALUE)) for name in balances),
        *(OdeEffect(f"state-clip:{name}") for name in balances),
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
    supported, found = set(GAIN_EFFECTS), []
    states = {each.name: each for each in system.states}
    for each in list_terms(system):
        cause, _, place = each.name.partition(":")
        unit = states[place].unit if place in states else ""
        if each.name in _SUPPORTED:
            supported.add(each.name)
        elif cause == "input-offset" and place and each.term:
            # A listed offset has the unit of the input, which its term converts.
            own = () if system.effects else (f"{unit or '1'}/s", sizes[f"d{place}/dt"])
            found.append(input_offset(place, *own))
        elif cause == "outflow-law" and place and each.term:
            found.append(outflow_law(place))
        elif cause == "state-clip" and place in states and not each.term:
            # A listed limit has the size of the output: that of a state which is not measured is uncertain.
            size = 0.0 if system.effects else sizes[place]
            found.append(state_clip(place, unit or "1", size, spills=bool(states[place].spills_into)))
        else:
            raise ModelError(
                f"[effects] {each.name}: there is no such effect: take input-offset:NAME, outflow-law:NAME, "
                f"{', '.join(sorted(_SUPPORTED))}, each with equation and term, or state-clip:STATE"
            )
    return frozenset(supported), tuple(found)
