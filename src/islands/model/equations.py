"""A model as one equation, in plain text and in LaTeX."""

from collections.abc import Sequence

from islands.model.expression import Constant
from islands.model.model import Model
from islands.model.text import latex_factor, latex_number, plain_factor


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
