"""Models as text of other kinds: one entry in the table, and a model can be exported that way."""

import inspect
import math
import textwrap
from collections.abc import Callable, Mapping
from types import MappingProxyType

from islands.errors import ModelError, chosen
from islands.io.models import model_json
from islands.model.equations import equation, latex_equation
from islands.model.expression import Apply, Constant, Expression, Lagged, Primitive, walk
from islands.model.model import Model

_INFIX = {"add": " + ", "sub": " - ", "mul": "*"}


def python(model: Model) -> str:
    """Write a model as a Python module of its own: ``predict`` one sample, ``simulate`` a free run.

    It needs no library, and computes the same numbers as this package's kernels, bit for bit: sums and
    products stand in the same order.

    Raises
    ------
    ModelError
        The model has no parameters, or a primitive of the user's has no source at hand.
    """
    signals = ["y", *_input_arguments(model)]
    terms = [
        _term(parameter, item.expression, signals)
        for parameter, item in zip(model.parameters, model.regressors, strict=True)
    ]
    used = {
        node.primitive.name: node.primitive
        for item in model.regressors
        for node in walk(item.expression)
        if isinstance(node, Apply) and node.primitive.name not in _INFIX
    }
    inputs = ", ".join(signals[1:])
    return _MODULE.format(
        equation=equation(model),
        names=", ".join(
            f"{argument} = {name}" for argument, name in zip(signals[1:], model.input_names, strict=True)
        ),
        output=model.output_name,
        dt="any" if model.dt is None else f"{model.dt!r} s",
        lag=model.maximum_lag,
        functions="".join(_function(used[name]) for name in sorted(used)),
        inputs=inputs,
        first_input=signals[1],
        terms="\n        + ".join(terms),
    )


_MODULE = '''"""NARX model: {equation}

Inputs {names}; output y = {output}; sampling time {dt}.
"""

import math

MAXIMUM_LAG = {lag}

{functions}
def predict(k, y, {inputs}):
    """Return y(k) from the samples before it."""
    return (
        {terms}
    )


def simulate({inputs}, y0):
    """Run free over the inputs, from the first MAXIMUM_LAG outputs y0."""
    y = [float(value) for value in y0[:MAXIMUM_LAG]]
    for k in range(MAXIMUM_LAG, len({first_input})):
        y.append(predict(k, y, {inputs}))
    return y
'''


def _input_arguments(model: Model) -> list[str]:
    return ["u"] if model.inputs == 1 else [f"u{index + 1}" for index in range(model.inputs)]


def _term(parameter: float, expression: Expression, signals: list[str]) -> str:
    if expression == Constant(1.0):
        return repr(parameter)
    return f"{parameter!r}*{_python(expression, signals)}"


def _python(expression: Expression, signals: list[str]) -> str:
    match expression:
        case Lagged(channel, lag):
            return f"{signals[channel]}[k-{lag}]"
        case Constant(value):
            return repr(value) if value >= 0.0 else f"({value!r})"
        case Apply(primitive, arguments) if primitive.name in _INFIX:
            # The kernel multiplies a term's factors first and its parameter last: brackets keep that order.
            return f"({_INFIX[primitive.name].join(_python(argument, signals) for argument in arguments)})"
        case Apply(primitive, arguments):
            inner = ", ".join(_python(argument, signals) for argument in arguments)
            return f"{primitive.scalar.__name__}({inner})"
    raise ModelError(f"{expression!r} is not in canonical form")


def _function(primitive: Primitive) -> str:
    """Return the source of a primitive's scalar function, with the numbers it takes from its module."""
    scalar = primitive.scalar
    try:
        source = textwrap.dedent(inspect.getsource(scalar))
    except OSError as error:
        raise ModelError(
            f"the source of primitive {primitive.name!r} is not at hand: define it in a file"
        ) from error
    if not source.startswith("def "):
        raise ModelError(
            f"primitive {primitive.name!r} can't be exported: write it with def, not as a lambda"
        )
    lines = []
    for name in scalar.__code__.co_names:
        held = scalar.__globals__.get(name)
        if isinstance(held, int | float):
            lines.append(f"{name} = {held!r}\n")
        elif held is not None and held is not math:
            raise ModelError(
                f"primitive {primitive.name!r} uses {name}: an export knows math and numbers alone"
            )
    return "".join(lines) + ("\n\n" if lines else "\n") + source + "\n"


EXPORTS: Mapping[str, Callable[[Model], str]] = MappingProxyType(
    {"plain": equation, "latex": latex_equation, "python": python, "json": model_json}
)


def export(model: Model, kind: str) -> str:
    """Return a model as text of a kind in ``EXPORTS``.

    Raises
    ------
    SettingsError
        There is no such kind.
    """
    return chosen(EXPORTS, kind, "format")(model)
