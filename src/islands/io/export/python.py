"""A model as a Python module of its own, that needs no library."""

import inspect
import math
import re
import textwrap
from collections.abc import Sequence
from numbers import Integral, Real

from islands.errors import ModelError
from islands.io.export.parts import description, functions, signals, terms
from islands.model.equations import equation
from islands.model.expression import Primitive
from islands.model.model import Model

_MODULE = '''"""NARX model: {equation}

{description}
"""

import math

MAXIMUM_LAG = {lag}
{constants}

{functions}def predict(k, y, {inputs}):
    """Return y(k) from the samples before it."""
    total = 0.0
    {terms}
    return total


def simulate({inputs}, y0):
    """Run free over the inputs, from the first MAXIMUM_LAG outputs y0."""
    y = [float(value) for value in y0[:MAXIMUM_LAG]]
    for k in range(MAXIMUM_LAG, len({first_input})):
        y.append(predict(k, y, {inputs}))
    return y
'''


def python_source(model: Model) -> str:
    """Write a model as a Python module of its own: ``predict`` one sample, ``simulate`` a free run.

    It needs no library, and computes the same numbers as this package's kernels, bit for bit: sums and
    products stand in the same order.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a primitive of the user's can't stand alone: its source is
        not at hand, or it needs more than ``math`` and numbers.
    """
    used = functions(model)
    inputs = signals(model)[1:]
    written = terms(model, lambda name, lag: f"{name}[k-{lag}]", _name)
    sources = [_function(primitive) for primitive in used]
    return _MODULE.format(
        equation=equation(model),
        description=description(model, _quoted),
        lag=model.maximum_lag,
        constants="".join(f"{name} = {value}\n" for name, value in _constants(used).items()),
        functions="\n\n".join(sources) + ("\n\n" if sources else ""),
        inputs=", ".join(inputs),
        first_input=inputs[0],
        terms="\n    ".join(f"total += {term}" for term in written),
    )


def _name(primitive: Primitive) -> str:
    return f"_{primitive.name}"


def _quoted(name: str) -> str:
    """Return a column's name as it may stand in a docstring, on one line."""
    escaped = name.replace("\\", r"\\").replace('"', r"\"")
    return "".join(mark if mark.isprintable() else mark.encode("unicode_escape").decode() for mark in escaped)


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
