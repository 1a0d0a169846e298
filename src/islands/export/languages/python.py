"""Export of a model as a self-contained Python module."""

import inspect
import math
import re
import textwrap
from collections.abc import Sequence
from numbers import Integral, Real

from islands.errors import ModelError
from islands.expressions.tree import Primitive
from islands.models.block import Block

_MODULE = '''"""NARX model: {equation}

{description}

{note}
"""

import math

MAXIMUM_LAG = {lag}
{constants}

{functions}def predict(k, y, {inputs}):
    """Return y(k) from the preceding samples."""
    total = 0.0
    {terms}
    return total


def simulate({inputs}, y0):
    """Return the free run from the inputs and the first MAXIMUM_LAG outputs y0."""
    y = [float(value) for value in y0[:MAXIMUM_LAG]]
    for k in range(MAXIMUM_LAG, len({first_input})):
        y.append(predict(k, y, {inputs}))
    return y
'''

_SIGNALS_MODULE = '''"""{title}

{equations}

{description}

{note}
"""

import math

MAXIMUM_LAG = {lag}
{constants}

{functions}def predict(k, {signals}):
    """Return {computed} at sample k from the preceding samples."""
{equations_code}
    return {results}


def simulate({inputs}, {starts}):
    """Return the free run from the inputs and the first MAXIMUM_LAG outputs."""
    {first_samples}
    for k in range(MAXIMUM_LAG, len({first_input})):
        {results} = predict(k, {signals})
        {appends}
    return {outputs}
'''

_STATE_SPACE_MODULE = '''"""{title}

{equations}

{description}

{note}
"""

import math

#: States at sample 0 unless others are given: {states}.
START = {start}
{constants}

{functions}def advance(k, {states}, {inputs}):
    """Return {states} at sample k from sample k - 1."""
{advance_code}
    return {next_states}


def observe(k, {states}, {inputs}):
    """Return {outputs} at sample k from the states and inputs of that sample."""
{observe_code}
    return {next_outputs}


def simulate({inputs}, start=START):
    """Return {outputs} at all samples from the inputs and the states at sample 0."""
    {first_samples}
    for k in range(len({first_input})):
        if k > 0:
            {next_states} = advance(k, {states}, {inputs})
            {append_states}
        {next_outputs} = observe(k, {states}, {inputs})
        {append_outputs}
    return {outputs}
'''


def python_source(block: Block) -> str:
    """Return a block as the source of a Python module.

    The module defines the functions ``predict`` (one sample) and ``simulate`` (free run). It needs only the
    standard library. Sums and products are evaluated in the same order as in this package's kernels.

    Raises
    ------
    ModelError
        The model has no finite parameters, or a user-defined primitive cannot be exported: its source is not
        available, or it uses globals other than ``math`` and numbers.
    """
    names, inputs, used = block.signals[: block.computed], block.signals[block.computed :], block.primitives
    sources = [function_source(primitive) for primitive in used]
    shared = {
        "description": block.describe_signals(escape_name),
        "note": block.describe_start(""),
        "lag": block.maximum_lag,
        "constants": "".join(f"{name} = {value}\n" for name, value in required_globals(used).items()),
        "functions": "\n\n".join(sources) + ("\n\n" if sources else ""),
        "inputs": ", ".join(inputs),
        "first_input": inputs[0],
    }
    if block.computed == 1:
        terms = block.terms(0, _write_sample, python_name)
        return _MODULE.format(
            equation=block.texts[0], terms="\n    ".join(f"total += {term}" for term in terms), **shared
        )
    outputs, states = names[: block.outputs], names[block.outputs :]
    shared |= {
        "title": block.kind_title,
        "equations": "\n".join(block.texts),
        "outputs": ", ".join(outputs),
    }
    if block.is_state_space:
        first = [f"{name} = [start[{place}]]" for place, name in enumerate(states)]
        return _STATE_SPACE_MODULE.format(
            states=", ".join(states),
            start=block.first_states(),
            advance_code=_write_equations(block, states),
            observe_code=_write_equations(block, outputs),
            next_states=_name_next(states),
            next_outputs=_name_next(outputs),
            first_samples="\n    ".join([*first, *(f"{name} = []" for name in outputs)]),
            append_states="\n            ".join(_append_next(states)),
            append_outputs="\n        ".join(_append_next(outputs)),
            **shared,
        )
    first = [f"{name} = [float(value) for value in first_{name}[:MAXIMUM_LAG]]" for name in outputs]
    for place, name in enumerate(states):
        start = block.start_text(place, _write_sample, python_name)
        first.append(f"{name} = [{start} for k in range(MAXIMUM_LAG)]")
    return _SIGNALS_MODULE.format(
        signals=", ".join(block.signals),
        computed=", ".join(names),
        starts=", ".join(f"first_{output}" for output in outputs),
        first_samples="\n    ".join(first),
        results=_name_next(names),
        equations_code=_write_equations(block, (*states, *outputs)),
        appends="\n        ".join(_append_next(names)),
        **shared,
    )


def _write_equations(block: Block, names: Sequence[str]) -> str:
    """Return the statements that compute signals; those of the same sample are in the variables next_..."""

    def write(name: str, lag: int) -> str:
        return f"next_{name}" if not lag and name in names else _write_sample(name, lag)

    lines = []
    for name in names:
        terms = block.terms(block.signals.index(name), write, python_name)
        lines += [f"    next_{name} = 0.0", *(f"    next_{name} += {term}" for term in terms)]
    return "\n".join(lines)


def _name_next(names: Sequence[str]) -> str:
    return ", ".join(f"next_{name}" for name in names)


def _append_next(names: Sequence[str]) -> list[str]:
    return [f"{name}.append(next_{name})" for name in names]


def _write_sample(name: str, lag: int) -> str:
    return f"{name}[k-{lag}]" if lag else f"{name}[k]"


def python_name(primitive: Primitive) -> str:
    """Return the name of a primitive's Python function."""
    return f"_{primitive.name}"


def escape_name(name: str) -> str:
    """Return a column name escaped for a docstring, on one line."""
    escaped = name.replace("\\", r"\\").replace('"', r"\"")
    return "".join(mark if mark.isprintable() else mark.encode("unicode_escape").decode() for mark in escaped)


def function_source(primitive: Primitive) -> str:
    """Return the source of a primitive's scalar function, with an underscore before its name.

    Raises
    ------
    ModelError
        The source is not available, or is not a function definition.
    """
    try:
        source = textwrap.dedent(inspect.getsource(primitive.scalar))
    except (OSError, TypeError) as error:
        raise ModelError(
            f"the source of primitive {primitive.name!r} is not available: define it with def in a file"
        ) from error
    if not source.startswith("def "):
        raise ModelError(
            f"primitive {primitive.name!r} can't be exported: write it with def, not as a lambda and without "
            "a decorator"
        )
    return re.sub(r"def \w+", f"def _{primitive.name}", source, count=1)


def required_globals(primitives: Sequence[Primitive]) -> dict[str, str]:
    """Return the module-level names that the functions use, with their Python source.

    Raises
    ------
    ModelError
        A function uses a global other than ``math`` and numbers, or a name of the exported module.
    """
    reserved = {"math": "math", "MAXIMUM_LAG": "", "predict": "", "simulate": ""}
    reserved |= {f"_{primitive.name}": "" for primitive in primitives}
    found: dict[str, str] = {}
    for primitive in primitives:
        closure = inspect.getclosurevars(primitive.scalar)
        for name, value in {**closure.globals, **closure.nonlocals}.items():
            source = _value_source(value)
            if source is None:
                raise ModelError(
                    f"primitive {primitive.name!r} uses {name}: an export may only use math and numbers"
                )
            if (reserved | found).get(name, source) != source:
                raise ModelError(
                    f"primitive {primitive.name!r} uses {name}, a name that means something else in the "
                    "export: rename it"
                )
            if name not in reserved:
                found[name] = source
    return found


def _value_source(value: object) -> str | None:
    """Return the Python source of a number, of ``math`` or of a function of it; None for other values."""
    if value is math:
        return "math"
    if isinstance(value, Integral):
        return repr(int(value))
    if isinstance(value, Real):
        return repr(float(value)) if math.isfinite(value) else f"float('{float(value)}')"
    name = getattr(value, "__name__", "")
    return f"math.{name}" if value is not None and getattr(math, name, None) is value else None
