"""A model as one equation, in plain text, in LaTeX and in MathML."""

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

#: Visible characters of a row of MathML.
_ROW = 80


def equation(model: Model, digits: int = 6) -> str:
    """Write a model as one line: ``y(k) = 1*y(k-1) + 0.77*(u(k-1) - u(k-2))``.

    The parameters are rounded to ``digits`` significant digits; a model without parameters shows theta1 ...
    """
    parts = []
    for position, item in enumerate(model.regressors):
        weight = f"theta{position + 1}" if model.theta is None else f"{model.theta[position]:.{digits}g}"
        constant = item.expression == Constant(1.0)
        parts.append(weight if constant else f"{weight}*{plain_factor(item.expression, model.inputs)}")
    return f"y(k) = {_joined(parts)}"


def latex_equation(model: Model, digits: int = 6) -> str:
    """Write a model as one line of LaTeX, without dollars."""
    parts = []
    for position, item in enumerate(model.regressors):
        weight = (
            rf"\theta_{{{position + 1}}}"
            if model.theta is None
            else latex_number(f"{model.theta[position]:.{digits}g}")
        )
        constant = item.expression == Constant(1.0)
        parts.append(weight if constant else rf"{weight} \, {latex_factor(item.expression, model.inputs)}")
    return f"y_{{k}} = {_joined(parts)}"


def _joined(terms: Sequence[str]) -> str:
    return " + ".join(terms).replace("+ -", "- ")


def mathml_equation(model: Model, digits: int = 6) -> str:
    """Write a model as an element ``math``, in ASCII, that browsers show without any library.

    Browsers break no equation: a long one is a table of several rows.
    """
    left = f"{mathml(Lagged(0, 0))}<mo>=</mo>"
    rows = _rows(_mathml_terms(model, digits))
    if len(rows) == 1:
        return f'<math display="block"><mrow>{left}{rows[0]}</mrow></math>'
    lines = [
        f'<mtr><mtd>{"" if index else left}</mtd><mtd style="text-align: left">{row}</mtd></mtr>'
        for index, row in enumerate(rows)
    ]
    return f'<math display="block"><mtable>{"".join(lines)}</mtable></math>'


def _mathml_terms(model: Model, digits: int) -> list[str]:
    """Return every term with the sign before it."""
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
        # Where a sign begins a row, it stands between two terms all the same.
        parts.append((sign.replace("<mo>", '<mo form="infix">') if position else sign) + weight)
    return parts


def _rows(terms: Sequence[str]) -> list[str]:
    """Join terms to rows of at most `_ROW` visible characters, but for a longer term."""
    rows, length = [terms[0]], _characters(terms[0])
    for term in terms[1:]:
        if length + _characters(term) > _ROW:
            rows.append("")
            length = 0
        rows[-1] += term
        length += _characters(term)
    return rows


def _characters(element: str) -> int:
    return len(unescape(re.sub("<[^>]*>", "", element)))
