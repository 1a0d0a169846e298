"""Equation of a model in plain text, LaTeX and MathML."""

import re
from collections.abc import Sequence
from html import unescape

from islands.model.expression import Constant, Lagged
from islands.model.model import Model
from islands.model.rendering import (
    MINUS,
    TIMES,
    latex_factor,
    latex_number,
    mathml,
    mathml_factor,
    mathml_number,
    plain_factor,
)

#: Maximum number of visible characters of a row of MathML.
_ROW_CHARACTERS = 80


def equation(model: Model, digits: int = 6) -> str:
    """Write a model as one line: ``y(k) = 1*y(k-1) + 0.77*(u(k-1) - u(k-2))``.

    The parameters are rounded to ``digits`` significant digits. A model without parameters shows theta1 ...
    """
    parts = []
    for position, item in enumerate(model.regressors):
        weight = f"theta{position + 1}" if model.theta is None else f"{model.theta[position]:.{digits}g}"
        constant = item.expression == Constant(1.0)
        parts.append(weight if constant else f"{weight}*{plain_factor(item.expression, model.inputs)}")
    return f"y(k) = {_join_terms(parts)}"


def latex_equation(model: Model, digits: int = 6) -> str:
    """Write a model as one line of LaTeX without dollar signs."""
    parts = []
    for position, item in enumerate(model.regressors):
        weight = (
            rf"\theta_{{{position + 1}}}"
            if model.theta is None
            else latex_number(f"{model.theta[position]:.{digits}g}")
        )
        constant = item.expression == Constant(1.0)
        parts.append(weight if constant else rf"{weight} \, {latex_factor(item.expression, model.inputs)}")
    return f"y_{{k}} = {_join_terms(parts)}"


def _join_terms(terms: Sequence[str]) -> str:
    return " + ".join(terms).replace("+ -", "- ")


def mathml_equation(model: Model, digits: int = 6) -> str:
    """Write a model as a ``math`` element in ASCII that browsers render without a library.

    Browsers do not break the lines of an equation, so a long equation is a table of several rows.
    """
    left = f"{mathml(Lagged(0, 0))}<mo>=</mo>"
    rows = _break_rows(_mathml_terms(model, digits))
    if len(rows) == 1:
        return f'<math display="block"><mrow>{left}{rows[0]}</mrow></math>'
    lines = [
        f'<mtr><mtd>{"" if index else left}</mtd><mtd style="text-align: left">{row}</mtd></mtr>'
        for index, row in enumerate(rows)
    ]
    return f'<math display="block"><mtable>{"".join(lines)}</mtable></math>'


def _mathml_terms(model: Model, digits: int) -> list[str]:
    """Return the terms of the model, each with its sign."""
    parts = []
    for position, item in enumerate(model.regressors):
        number = f"theta{position + 1}" if model.theta is None else f"{model.theta[position]:.{digits}g}"
        if model.theta is None:
            weight = f"<msub><mi>&#x3B8;</mi><mn>{position + 1}</mn></msub>"
        else:
            weight = mathml_number(number.removeprefix("-"))
        if item.expression != Constant(1.0):
            weight += TIMES + mathml_factor(item.expression, model.inputs)
        sign = MINUS if number.startswith("-") else "<mo>+</mo>" if position else ""
        # At the start of a row the sign is still a binary operator.
        parts.append((sign.replace("<mo>", '<mo form="infix">') if position else sign) + weight)
    return parts


def _break_rows(terms: Sequence[str]) -> list[str]:
    """Join terms to rows of at most `_ROW_CHARACTERS` visible characters; a longer term has its own row."""
    rows, length = [terms[0]], _count_characters(terms[0])
    for term in terms[1:]:
        if length + _count_characters(term) > _ROW_CHARACTERS:
            rows.append("")
            length = 0
        rows[-1] += term
        length += _count_characters(term)
    return rows


def _count_characters(element: str) -> int:
    return len(unescape(re.sub("<[^>]*>", "", element)))
