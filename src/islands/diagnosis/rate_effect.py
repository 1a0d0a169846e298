"""Cause that acts on a rate, over which a report shows the residual."""

from islands.diagnosis.result import Diagnosis
from islands.effects.interface.effect import Effect, ForceLaw
from islands.expressions.parsing import parse_formula
from islands.expressions.tree import find_symbols


def find_rate_effect(diagnosis: Diagnosis) -> Effect | None:
    """Return the first claimed effect that is a function of a rate which the record or its output has.

    Returns
    -------
    Effect or None
        None without such an effect, or if forces act on a coordinate that is neither input nor output.
    """
    coordinate = diagnosis.best.simulation.context.force_coordinate
    if coordinate.is_dissipative and not coordinate.is_output:
        return None
    effects = (each for each in diagnosis.best.simulation.effects if each.name in diagnosis.claimed_names)
    return next((each for each in effects if _reads_rate(each)), None)


def _reads_rate(effect: Effect) -> bool:
    if not isinstance(effect.form, ForceLaw) or effect.formula is None or effect.formula.states:
        return False
    names = set(find_symbols(parse_formula(effect.formula.text)))
    return "v" in names and "x" not in names
