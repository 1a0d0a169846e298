"""What the programs of a model have in common: their terms, the functions they call, what they say of it."""

import json
import math
import re
import textwrap
from collections.abc import Callable

from islands.errors import ModelError
from islands.io.export.infix import OPERATORS, infix
from islands.model.equations import equation
from islands.model.expression import Apply, Constant, Primitive, walk
from islands.model.model import Model

#: C and MATLAB tell 63 characters of a name apart, and know no Greek letters.
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,59}")

#: What a body of a function looks like, by the field of `Primitive`.
_EXAMPLES = {"c": "return a / (1.0 + fabs(a));", "matlab": "r = a / (1 + abs(a));"}


def signals(model: Model) -> list[str]:
    """Return the names of the output and of the inputs: y, and u or u1, u2 .. where there are several."""
    return ["y", "u"] if model.inputs == 1 else ["y", *(f"u{index + 1}" for index in range(model.inputs))]


def terms(model: Model, sample: Callable[[str, int], str], function: Callable[[Primitive], str]) -> list[str]:
    """Write the terms in the order in which the kernels add them.

    Parameters
    ----------
    sample : callable
        ``sample("u", 2)`` writes a signal two samples back.
    function : callable
        As in `infix`.

    Raises
    ------
    ModelError
        The model has no parameters, or one that is not finite.
    """
    names = signals(model)
    written = []
    for parameter, item in zip(model.parameters, model.regressors, strict=True):
        if not math.isfinite(parameter):
            raise ModelError(f"the parameter of {item.text} is {parameter}: a program needs finite ones")
        text = repr(float(parameter))
        if item.expression != Constant(1.0):
            text += "*" + infix(item.expression, lambda channel, lag: sample(names[channel], lag), function)
        written.append(text)
    return written


def functions(model: Model) -> list[Primitive]:
    """Return the primitives that are called, each once, in the order of their names."""
    called = {
        node.primitive.name: node.primitive
        for item in model.regressors
        for node in walk(item.expression)
        if isinstance(node, Apply) and node.primitive.name not in OPERATORS
    }
    return [called[name] for name in sorted(called)]


def body(primitive: Primitive, language: str) -> str:
    """Return the body of a primitive's function in C or MATLAB.

    Parameters
    ----------
    language : str
        The field of `Primitive`: c or matlab.

    Raises
    ------
    ModelError
        It has none, or its name is no name in the language.
    """
    name, text = primitive.name, getattr(primitive, language)
    if not text:
        raise ModelError(
            f"primitive {name!r} has no text in this language: give the body of its function when you make "
            f"it, primitive({name!r}, ..., {language}={_EXAMPLES[language]!r})"
        )
    if not _NAME.fullmatch(name):
        raise ModelError(
            f"primitive {name!r} can't be exported in this language: name it with at most 60 of the "
            "characters A-Z, a-z, 0-9 and _"
        )
    return str(text)


def description(model: Model, quoted: Callable[[str], str]) -> str:
    """Tell what the signals are; ``quoted`` writes a column's name so that it may stand in a comment."""
    names = zip(signals(model)[1:], model.input_names, strict=True)
    inputs = ", ".join(f"{signal} = {quoted(name)}" for signal, name in names)
    dt = "any" if model.dt is None else f"{float(model.dt)!r} s"
    return f"Inputs {inputs}; output y = {quoted(model.output_name)}; sampling time {dt}."


def heading(model: Model, mark: str) -> str:
    """Tell equation and signals in ASCII, in a comment whose lines begin with a mark."""
    lines = textwrap.wrap(
        f"NARX model: {equation(model)}", width=100, subsequent_indent="    ", break_long_words=False
    )
    # The names stay on one line: broken behind a backslash, they would join it to the next one in C.
    return "\n".join(f"{mark} {line}".rstrip() for line in [*lines, "", description(model, _quoted)])


def _quoted(name: str) -> str:
    """Return a name in JSON's quotes: ASCII, without line ends, and without an asterisk to end a comment."""
    return json.dumps(name).replace("*", r"\u002a")
