"""The published models on a record: as printed, within the rounding of Table 2, and estimated again."""

from collections.abc import Mapping
from math import floor, log10

import numpy as np

from islands.evolution.paper_search import estimate_again
from islands.expressions.parsing import parse
from islands.models.narx import Model, make_model
from islands.records.dataset import Dataset
from islands.systems.published_models import Published
from islands.validation.physics import check_physics
from lab.reproduction.searches import measure_errors, model_document
from lab.reproduction.tasks import Document

#: Significant digits of Table 2, and the value that is printed with two.
_DIGITS, _TWO_DIGITS = 3, 0.77

#: Deviation in per cent up to which errors are called equal.
_EQUAL = 0.5

#: Standard errors within which an estimate agrees with a published value.
_AGREES = 2.0


def half_digit(value: float) -> float:
    """Return half a unit of the last printed digit of a parameter of Table 2; 0 for 1.00, which is exact.

    Property 1 fixes the parameter of the only linear output term at 1.
    """
    if value == 1.0:
        return 0.0
    digits = 2 if value == _TWO_DIGITS else _DIGITS
    return float(0.5 * 10.0 ** (floor(log10(abs(value))) - digits + 1))


def assess_published(
    published: Published, records: Mapping[str, Dataset], draws: int, printed: bool = True
) -> Document:
    """Return the errors of a published model, and its parameters next to those of least squares.

    Parameters
    ----------
    published : Published
    records : mapping of Dataset
        The first record is the estimation data.
    draws : int
        Parameter vectors that round to the printed one, drawn at random, for the range of the errors.
    printed : bool
        Whether the printed parameters are valid on these records.

    Returns
    -------
    dict
        ``printed`` and ``estimated`` errors by record; ``rounding``, smallest and largest errors of vectors
        that round to the printed one; ``parameters`` in the order and with the signs of Table 2; ``model``.
    """
    estimation = next(iter(records.values()))
    estimated = estimate_again(published, estimation)
    document: Document = {
        "estimated": measure_errors(estimated, records),
        "parameters": _compare_parameters(published, estimated),
        "model": model_document(estimated),
        "property_1": check_physics(estimated, estimation).property_1,
    }
    if printed:
        document["printed"] = measure_errors(published.model, records)
        document["rounding"] = _measure_rounding(published, records, draws)
    return document


def _compare_parameters(published: Published, estimated: Model) -> list[Document]:
    """Return printed and estimated parameters with the signs of the paper."""
    standard_errors = estimated.standard_errors or (0.0,) * estimated.size
    found = dict(
        zip(estimated.regressors, zip(estimated.parameters, standard_errors, strict=True), strict=True)
    )
    rows = []
    for text, value in published.terms.items():
        canonical = make_model([(parse(text), 1.0)])
        parameter, standard_error = found[canonical.regressors[0]]
        rows.append(
            {
                "term": text,
                "printed": value,
                "half_digit": half_digit(value),
                "estimated": canonical.parameters[0] * parameter,
                "standard_error": standard_error,
            }
        )
    return rows


def _measure_rounding(published: Published, records: Mapping[str, Dataset], draws: int) -> Document:
    """Return the range of each error over parameter vectors that round to the printed one."""
    rng = np.random.default_rng(0)
    values = np.array(list(published.terms.values()))
    halves = np.array([half_digit(value) for value in values])
    # Pairs that cancel in a cluster, as 3.14 and -3.14, have to cancel exactly.
    partner = [int(np.flatnonzero(values == -value)[0]) if -value in values else -1 for value in values]
    found: dict[str, dict[str, list[float]]] = {}
    for _ in range(draws):
        drawn = values + halves * rng.uniform(-1.0, 1.0, len(values))
        for one, other in enumerate(partner):
            if other > one:
                drawn[other] = -drawn[one]
        terms = zip(map(parse, published.terms), drawn.tolist(), strict=True)
        model = make_model(
            terms, published.model.input_names, published.model.output_name, published.model.dt
        )
        for name, errors in measure_errors(model, records).items():
            for metric, value in errors.items():
                if value is not None:
                    found.setdefault(name, {}).setdefault(metric, []).append(value)
    return {
        name: {metric: [min(values), max(values)] for metric, values in errors.items()}
        for name, errors in found.items()
    }


def count_different(document: Document) -> int:
    """Return the number of printed parameters that are not those of least squares."""
    return sum(_differs(row) for row in document["parameters"])


def _differs(row: Document) -> bool:
    difference = abs(row["estimated"] - row["printed"])
    return bool(difference > max(row["half_digit"] + 1e-12, _AGREES * row["standard_error"]))


def explain_error(published: float, document: Document, record: str, metric: str) -> str:
    """Say why a published error differs from those of the printed and of the estimated parameters.

    Parameters
    ----------
    published : float
    document : dict
        Result of `assess_published`.
    record, metric : str
        Name of the record and of the metric.
    """
    estimated = document["estimated"][record][metric]
    if estimated is None:
        return "The free run of the estimated model diverges."
    deviation = 100.0 * abs(estimated - published) / abs(published)
    if deviation <= _EQUAL:
        sentence = f"Estimated again: equal within {deviation:.2g} %."
    else:
        amount = f"{deviation:.2g} %" if deviation < 99.5 else f"a factor of {estimated / published:.2g}"
        sentence = f"Estimated again: {'larger' if estimated > published else 'smaller'} by {amount}"
        different = count_different(document)
        sentence += f"; {different} printed parameters are not those of least squares." if different else "."
    if metric in document.get("rounding", {}).get(record, {}):
        low, high = document["rounding"][record][metric]
        relation = "includes" if low <= published <= high else "does not include"
        sentence += (
            f" Printed: parameters that round to those of Table 2 give {low:.5g} to {high:.5g}, which "
            f"{relation} the published value."
        )
    return sentence


def format_error(error: float | None, digits: int = 5) -> str:
    """Write an error of a free run; None if it diverged."""
    return "diverges" if error is None else f"{error:.{digits}f}"


def explain_parameter(row: Document) -> str:
    """Say why a parameter of Table 2 differs from least squares."""
    difference, error = abs(row["estimated"] - row["printed"]), row["standard_error"]
    if difference <= row["half_digit"] + 1e-12:
        return "Equal to the printed digits." if row["half_digit"] else "Fixed by Property 1."
    ratio = f"{_round(difference / error)} standard errors" if error else f"{difference:.2g}"
    if not _differs(row):
        return f"{ratio} apart: the record does not determine the parameter more precisely."
    return f"{ratio} apart: the printed value is not that of least squares on this record."


def _round(number: float) -> str:
    """Write a positive number with two digits, without an exponent if it is large."""
    return f"{number:.0f}" if number >= 10.0 else f"{number:.2g}"
