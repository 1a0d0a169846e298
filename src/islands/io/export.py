"""Models as text of other kinds: one entry in the table, and a model can be exported that way."""

import inspect
import math
import re
import textwrap
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral, Real
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
        The model has no parameters, or a primitive of the user's can't stand alone: its source is not at
        hand, or it needs more than ``math`` and numbers.
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
    functions = [_function(used[name]) for name in sorted(used)]
    constants = _constants([used[name] for name in sorted(used)])
    return _MODULE.format(
        equation=equation(model),
        names=", ".join(
            f"{argument} = {_quoted(name)}"
            for argument, name in zip(signals[1:], model.input_names, strict=True)
        ),
        output=_quoted(model.output_name),
        dt="any" if model.dt is None else f"{model.dt!r} s",
        lag=model.maximum_lag,
        constants="".join(f"{name} = {value}\n" for name, value in constants.items()),
        functions="\n\n".join(functions) + ("\n\n" if functions else ""),
        inputs=inputs,
        first_input=signals[1],
        terms="\n        + ".join(terms),
    )


_MODULE = '''"""NARX model: {equation}

Inputs {names}; output y = {output}; sampling time {dt}.
"""

import math

MAXIMUM_LAG = {lag}
{constants}

{functions}def predict(k, y, {inputs}):
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
            return f"_{primitive.name}({inner})"
    raise ModelError(f"{expression!r} is not in canonical form")


def _quoted(name: str) -> str:
    """Return a column's name as it may stand in a docstring."""
    return name.replace("\\", r"\\").replace('"', r"\"")


def _function(primitive: Primitive) -> str:
    """Return the source of a primitive's scalar function, under a name of its own."""
    try:
        source = textwrap.dedent(inspect.getsource(primitive.scalar))
    except (OSError, TypeError) as error:
        raise ModelError(
            f"the source of primitive {primitive.name!r} is not at hand: define it with def in a file"
        ) from error
    if not source.startswith("def "):
        raise ModelError(
            f"primitive {primitive.name!r} can't be exported: write it with def, not as a lambda and without "
            "a decorator"
        )
    return re.sub(r"def \w+", f"def _{primitive.name}", source, count=1)


def _constants(primitives: Sequence[Primitive]) -> dict[str, str]:
    """Return what the functions take from their modules: numbers, and ``math`` by other names."""
    taken = {"math": "math", "MAXIMUM_LAG": "", "predict": "", "simulate": ""}
    taken |= {f"_{primitive.name}": "" for primitive in primitives}
    found: dict[str, str] = {}
    for primitive in primitives:
        held = inspect.getclosurevars(primitive.scalar)
        for name, value in {**held.globals, **held.nonlocals}.items():
            written = _written(value)
            if written is None:
                raise ModelError(
                    f"primitive {primitive.name!r} uses {name}: an export knows math and numbers alone"
                )
            if (taken | found).get(name, written) != written:
                raise ModelError(
                    f"primitive {primitive.name!r} uses {name}, a name that stands for something else in the "
                    "export: rename it"
                )
            if name not in taken:
                found[name] = written
    return found


def _written(value: object) -> str | None:
    """Return Python source of a number, of ``math`` or of one of its functions; None of anything else."""
    if value is math:
        return "math"
    if isinstance(value, Integral):
        return repr(int(value))
    if isinstance(value, Real):
        return repr(float(value)) if math.isfinite(value) else f"float('{float(value)}')"
    name = getattr(value, "__name__", "")
    return f"math.{name}" if value is not None and getattr(math, name, None) is value else None


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
