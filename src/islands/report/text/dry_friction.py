"""Dry friction in a model of a velocity: the constant that opposes the motion in each sample."""

import re
from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

#: Units of velocities: a length, an angle or revolutions by a time.
_VELOCITY: Final = re.compile(r"([kcmunµμ]?m|in|ft|m?rad|deg|°|rev|1)\s*/\s*(s|min|h)|rpm")

#: Terms whose sum is the friction, as long as the direction of motion does not change.
_OPPOSING: Final = re.compile(r"sign\(y\(k-\d+\)\)")

#: Terms that are linear in the only input.
_DRIVING: Final = re.compile(r"u\(k(-\d+)?\)")

#: Standard errors that a friction and a gain differ from zero by at least.
_SIGNIFICANT: Final = 3.0


class DryFriction(NamedTuple):
    """Dry friction of a model of a velocity.

    Attributes
    ----------
    step : float
        Change of the velocity in one sample, in the unit of the velocity.
    input : float or None
        Value of the only input that balances it, in the unit of the input. None if there are several inputs,
        or if the input has other terms than linear ones.
    """

    step: float
    input: float | None


def find_dry_friction(terms: Iterable[Mapping[str, Any]], unit: str) -> DryFriction | None:
    """Find dry friction: terms in the sign of the output that oppose the motion.

    Parameters
    ----------
    terms : iterable of mapping
        Terms of a model, with ``regressor``, ``parameter`` and ``standard_error``.
    unit : str
        Unit of the output.

    Returns
    -------
    DryFriction or None
        None if the unit is not that of a velocity, or if no significant term opposes the motion.

    Notes
    -----
    With ``y(k) = a y(k-1) + b u(k-1) - c sign(y(k-1))``, the friction changes the velocity by `c` in each
    sample, and the input ``c / b`` balances it.
    """
    listed = list(terms)
    if not _VELOCITY.fullmatch(unit):
        return None
    friction = _sum_terms(listed, _OPPOSING)
    if friction is None or friction > 0:
        return None
    reads_input = [term for term in listed if re.search(r"\bu\d*\(", term["regressor"])]
    linear = all(_DRIVING.fullmatch(term["regressor"]) for term in reads_input)
    gain = _sum_terms(reads_input, _DRIVING) if linear else None
    return DryFriction(-friction, None if gain is None else abs(friction / gain))


def _sum_terms(terms: Iterable[Mapping[str, Any]], kind: re.Pattern[str]) -> float | None:
    """Return the sum of the parameters of a kind of terms; None if it does not differ from zero."""
    found = [term for term in terms if kind.fullmatch(term["regressor"])]
    total = sum(float(term["parameter"]) for term in found)
    # The sum of the standard errors is not less than the standard error of the sum.
    limit = _SIGNIFICANT * sum(term["standard_error"] or 0.0 for term in found)
    return total if found and abs(total) > limit else None
