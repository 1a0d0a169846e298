"""Sentences about terms that are a known law: another rate in one direction, radiation, an elastic stop."""

from collections.abc import Mapping

from islands.diagnosis.discovery.candidate_terms import (
    RADIATION_FORM,
    STOP_FORMS,
    CandidateTerm,
    write_rate_size,
)
from islands.expressions.primitives import DIV
from islands.expressions.tree import Apply, Symbol
from islands.simulators.ode.system import OdeSystem

#: Where each of the elastic stops acts, and the sign of its coefficient if it pushes back.
_STOPS = (("beyond +-", -1.0), ("above ", -1.0), ("below -", 1.0))


def describe_law(term: CandidateTerm, number: int, system: OdeSystem, values: Mapping[str, float]) -> str:
    """Return what a term means for its process, without a period; empty if it is no such law.

    Parameters
    ----------
    term : CandidateTerm
    number : int
        Number of the term in the names of its parameters.
    system : OdeSystem
        Equations without the terms.
    values : mapping
        Values of the parameters.
    """
    own = dict(system.derivatives).get(term.target)
    state, (coefficient, *scales) = term.target, term.name_parameters(number)
    if own is None:
        return ""
    if term.text == write_rate_size(own):
        strength = values[coefficient]
        factors = (f"1 + {coefficient}", 1.0 + strength), (f"1 - {coefficient}", 1.0 - strength)
        match own:
            case Apply(primitive, (_, Symbol(time))) if primitive == DIV and time in values:
                what = f"the time constant {time} is"
                rising, falling = (f"{values[time] / each:.3g} s" for _, each in factors)
            case _:
                what = f"the rate of {state} is"
                rising, falling = (f"{name} = {each:.3g} times as large" for name, each in factors)
        found = f"{what} {rising} while {state} rises, and {falling} while it falls"
        return f"The process is slower in one direction: {found}"
    if term.text == RADIATION_FORM.limit.format(signal=state):
        return f"A loss by the fourth power of {state}, as by radiation of heat"
    if term.text == RADIATION_FORM.text.format(signal=state, scale="{scale}"):
        return (
            f"A loss by the fourth power of {state} + {scales[0]}, as by radiation of heat: {state} = "
            f"-{scales[0]} is the absolute zero"
        )
    return _describe_stop(term, number, system, values)


def _describe_stop(term: CandidateTerm, number: int, system: OdeSystem, values: Mapping[str, float]) -> str:
    """Return what an elastic stop means; empty if the term is none."""
    position = "" if system.force is None else system.force.coordinate
    for form, (place, sign) in zip(STOP_FORMS, _STOPS, strict=True):
        if term.text == form.text.format(signal=position, scale="{scale}"):
            coefficient, scale = term.name_parameters(number)
            law = "An elastic stop acts" if sign * values[coefficient] > 0.0 else "The spring is softer"
            return f"{law} where {position} is {place}{scale}"
    return ""
