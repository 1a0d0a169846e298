"""Table of the parameters of a model: estimate, standard error, interval and inclusion."""

from collections.abc import Iterable, Mapping
from typing import Any

#: Standard errors from an estimate to the ends of its 95 % interval (normal distribution).
_REACH = 1.96


#: Headings of terms, and those of parameters with names.
_TERMS, _NAMED = ("term", "parameter"), ("parameter", "value")

#: Text of a cell without a value.
_NONE = "-"


def list_terms(
    terms: Iterable[Mapping[str, Any]], named: bool = False
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the headings and the cells of the terms of a model: parameter, standard error and so on.

    Columns without any value are left out.

    Parameters
    ----------
    terms : iterable of mapping
        ``terms`` of a model in ``result.json``.
    named : bool
        Whether the model has parameters with names in place of terms.
    """
    headings = (*(_NAMED if named else _TERMS), "standard error", "95 % interval", "inclusion")
    rows = [
        (
            term["term"],
            f"{term['parameter']:.6g}",
            _state_error(term["standard_error"]),
            _state_interval(term["parameter"], term["standard_error"]),
            _NONE if term["inclusion"] is None else f"{term['inclusion']:.2f}",
        )
        for term in terms
    ]
    kept = [place for place in range(len(headings)) if any(row[place] != _NONE for row in rows)]
    return tuple(headings[place] for place in kept), [tuple(row[place] for place in kept) for row in rows]


def _state_error(error: float | None) -> str:
    if error is None:
        return _NONE
    return f"{error:.2g}" if error else "fixed"


def _state_interval(value: float, error: float | None) -> str:
    # The constraints determine a parameter without an error.
    return f"{value - _REACH * error:.6g} to {value + _REACH * error:.6g}" if error else _NONE
