"""Parts shared by all exported programs: signal names, terms, primitive functions, headings."""

import json
import math
import re
import textwrap
from collections.abc import Callable

from islands.errors import ModelError
from islands.expressions.printing import BRACKETED_OPERATORS, program_text
from islands.expressions.tree import Apply, Constant, Primitive, walk
from islands.model.equations import equation
from islands.model.model import Model
from islands.model.signal_statement import describe_values, symbols

#: C and MATLAB distinguish the first 63 characters of a name and allow ASCII letters only.
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,59}")

#: Example of a function body for error messages, by the field of `Primitive`.
_EXAMPLES = {"c": "return a / (1.0 + fabs(a));", "matlab": "r = a / (1 + abs(a));"}


def signals(model: Model) -> list[str]:
    """Return the names of the output and the inputs: y and u, or y, u1, u2 .. for several inputs."""
    return list(symbols(model.inputs))


def terms(model: Model, sample: Callable[[str, int], str], function: Callable[[Primitive], str]) -> list[str]:
    """Return the texts of the terms in the order in which the kernels add them.

    Parameters
    ----------
    sample : callable
        ``sample("u", 2)`` returns the text of the sample u(k-2). The lag is 0 only for an input that the
        model reads one sample early (``u_V+1``).
    function : callable
        As in `program_text`.

    Raises
    ------
    ModelError
        The model has no parameters, or a parameter is not finite.
    """
    names, leads = signals(model), model.leads
    texts = []
    for parameter, item in zip(model.parameters, model.regressors, strict=True):
        if not math.isfinite(parameter):
            raise ModelError(
                f"the parameter of {item.text} is {parameter}: an export needs finite parameters"
            )
        text = repr(float(parameter))
        if item.expression != Constant(1.0):
            text += "*" + program_text(
                item.expression, lambda channel, lag: sample(names[channel], lag - leads[channel]), function
            )
        texts.append(text)
    return texts


def functions(model: Model) -> list[Primitive]:
    """Return the primitives that the model calls as functions, sorted by name."""
    called = {
        node.primitive.name: node.primitive
        for item in model.regressors
        for node in walk(item.expression)
        if isinstance(node, Apply) and node.primitive.name not in BRACKETED_OPERATORS
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
        The primitive has no body, or its name is not a valid identifier of the language.
    """
    name, text = primitive.name, getattr(primitive, language)
    if not text:
        raise ModelError(
            f"primitive {name!r} has no body in this language: pass the body of its function when you create "
            f"it, primitive({name!r}, ..., {language}={_EXAMPLES[language]!r})"
        )
    if not _NAME.fullmatch(name):
        raise ModelError(
            f"primitive {name!r} can't be exported in this language: name it with at most 60 of the "
            "characters A-Z, a-z, 0-9 and _"
        )
    return str(text)


def description(model: Model, quote: Callable[[str], str]) -> str:
    """Describe the signals and the sampling time; ``quote`` escapes a column name for use in a comment."""
    names = zip(signals(model)[1:], model.column_names, strict=True)
    inputs = ", ".join(f"{signal} = {quote(name)}" for signal, name in names)
    dt = "any" if model.dt is None else f"{float(model.dt)!r} s"
    stated = [f"Inputs {inputs}", f"output y = {quote(model.output_name)}", f"sampling time {dt}"]
    return f"{'; '.join(filter(None, [*stated, describe_values(model)]))}."


def heading(model: Model, mark: str) -> str:
    """Return the equation and the signals as an ASCII comment; every line begins with ``mark``."""
    lines = textwrap.wrap(
        f"NARX model: {equation(model)}", width=100, subsequent_indent="    ", break_long_words=False
    )
    # The names stay on one line: in C, a line that ends with a backslash continues on the next one.
    return "\n".join(f"{mark} {line}".rstrip() for line in [*lines, "", description(model, quote_name)])


def quote_name(name: str) -> str:
    """Return a name as a JSON string: ASCII, no line breaks, and no asterisk that could end a C comment."""
    return json.dumps(name).replace("*", r"\u002a")
