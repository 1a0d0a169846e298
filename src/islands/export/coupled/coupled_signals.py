"""Signals of a coupled model in exported text: y1, y2, .. for the outputs, u or u1, u2, .. for the inputs."""

import re
import textwrap
from collections.abc import Callable, Sequence

from islands.export.parts import functions, quote_name, signals, terms
from islands.expressions.tree import Primitive
from islands.model.equations import equation
from islands.model.signal_statement import describe_values, join_statements
from islands.simulation.coupled_model import CoupledModel


def output_signals(model: CoupledModel) -> list[str]:
    """Return the names of the outputs: y1, y2, .."""
    return [f"y{place + 1}" for place in range(len(model.models))]


def input_signals(model: CoupledModel) -> list[str]:
    """Return the names of the inputs: u, or u1, u2, .. for several."""
    count = len(model.input_names)
    return ["u"] if count == 1 else [f"u{place + 1}" for place in range(count)]


def equation_signals(model: CoupledModel, place: int) -> dict[str, str]:
    """Return the name in the coupled model of every signal of one equation, ``{"y": "y2", "u2": "y1"}``."""
    names = [*output_signals(model), *input_signals(model)]
    channels = model.channels(place)
    return {
        name: names[channel] for name, channel in zip(signals(model.models[place]), channels, strict=True)
    }


def equation_text(model: CoupledModel, place: int) -> str:
    """Write one equation as one line: ``y1(k) = 0.9*y1(k-1) + 0.2*y2(k-1)``."""
    names = equation_signals(model, place)
    return re.sub(r"\b(y|u\d*)\(k(?=[-)])", lambda leaf: f"{names[leaf[1]]}(k", equation(model.models[place]))


def equation_terms(
    model: CoupledModel, place: int, sample: Callable[[str, int], str], function: Callable[[Primitive], str]
) -> list[str]:
    """Return the texts of the terms of one equation; see `terms`."""
    names = equation_signals(model, place)
    return terms(model.models[place], lambda name, lag: sample(names[name], lag), function)


def coupled_functions(model: CoupledModel) -> list[Primitive]:
    """Return the primitives that any equation calls as functions, sorted by name."""
    called = {each.name: each for single in model.models for each in functions(single)}
    return [called[name] for name in sorted(called)]


def coupled_description(model: CoupledModel, quote: Callable[[str], str]) -> str:
    """Describe the signals and the sampling time; ``quote`` escapes a column name for use in a comment."""
    first = model.models[0]
    inputs = _list_names(input_signals(model), first.column_names, quote)
    outputs = _list_names(output_signals(model), model.output_names, quote)
    dt = "any" if model.dt is None else f"{float(model.dt)!r} s"
    stated = [f"Inputs {inputs}", f"outputs {outputs}", f"sampling time {dt}"]
    return f"{'; '.join(filter(None, [*stated, describe_values(model)]))}."


def describe_coupled_signals(model: CoupledModel, names: Sequence[str]) -> str:
    """State which signals the equations read; see `describe_signals`.

    Parameters
    ----------
    model : CoupledModel
    names : sequence of str
        Names of the outputs and of the inputs in the equations.
    """
    offsets = [each.preprocessing.output_offset for each in model.models if each.preprocessing]
    offsets += model.preprocessing.input_offsets if model.preprocessing else ()
    inputs = model.models[0].column_names[: len(model.input_names)]
    return join_statements(model, names, (*model.output_names, *inputs), offsets)


def _list_names(names: Sequence[str], columns: Sequence[str], quote: Callable[[str], str]) -> str:
    return ", ".join(f"{name} = {quote(column)}" for name, column in zip(names, columns, strict=False))


def coupled_heading(model: CoupledModel, mark: str) -> str:
    """Return the equations and the signals as an ASCII comment; every line begins with ``mark``."""
    lines = ["Coupled NARX model:", ""]
    for place in range(len(model.models)):
        lines += textwrap.wrap(
            equation_text(model, place), width=100, subsequent_indent="    ", break_long_words=False
        )
    return "\n".join(
        f"{mark} {line}".rstrip() for line in [*lines, "", coupled_description(model, quote_name)]
    )
