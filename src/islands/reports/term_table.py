"""Cells of the parameters of a model: estimate, standard error, interval and inclusion."""

from collections.abc import Iterable, Mapping
from typing import Any

#: Standard errors from an estimate to the ends of its 95 % interval (normal distribution).
_REACH = 1.96


def list_terms(terms: Iterable[Mapping[str, Any]]) -> list[tuple[str, str, str, str, str]]:
    """Return the term, parameter, standard error, 95 % interval and inclusion probability of each term.

    Parameters
    ----------
    terms : iterable of mapping
        ``terms`` of a model in ``result.json``.
    """
    return [
        (
            term["term"],
            f"{term['parameter']:.6g}",
            _state_error(term["standard_error"]),
            _state_interval(term["parameter"], term["standard_error"]),
            "-" if term["inclusion"] is None else f"{term['inclusion']:.2f}",
        )
        for term in terms
    ]


def _state_error(error: float | None) -> str:
    if error is None:
        return "-"
    return f"{error:.2g}" if error else "fixed"


def _state_interval(value: float, error: float | None) -> str:
    # The constraints determine a parameter without an error.
    return f"{value - _REACH * error:.6g} to {value + _REACH * error:.6g}" if error else "-"
