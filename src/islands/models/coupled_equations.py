"""Equations of a model of several outputs in plain text, LaTeX and MathML.

They have the signals y1, y2, .. for the outputs, and u or u1, u2, .. for the inputs.
"""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from islands.models.equations import (
    latex_equation,
    latex_statement,
    mathml_equation,
    mathml_statement,
    named_equation,
    signal_names,
)
from islands.models.signal_statement import join_statements, symbols

if TYPE_CHECKING:
    from islands.models.coupled_narx import CoupledModel


def output_signals(model: "CoupledModel") -> list[str]:
    """Return the names of the outputs: y1, y2, .."""
    return [f"y{place + 1}" for place in range(len(model.models))]


def input_signals(model: "CoupledModel") -> list[str]:
    """Return the names of the inputs: u, or u1, u2, .. for several."""
    count = len(model.input_names)
    return ["u"] if count == 1 else [f"u{place + 1}" for place in range(count)]


def equation_signals(model: "CoupledModel", place: int) -> dict[str, str]:
    """Return the name in the coupled model of every signal of one equation, ``{"y": "y2", "u2": "y1"}``."""
    names = [*output_signals(model), *input_signals(model)]
    channels = model.channels(place)
    return {
        name: names[channel]
        for name, channel in zip(symbols(model.models[place].inputs), channels, strict=True)
    }


def coupled_equation(model: "CoupledModel") -> str:
    """Write one line per output, with the column names of the record."""
    return "\n".join(named_equation(single) for single in model.models)


def coupled_signals(model: "CoupledModel") -> str:
    """State which signals the equations read, with the column names of the record."""
    outputs = (signal_names(single)[0] for single in model.models)
    inputs = signal_names(model.models[0])[1 : 1 + len(model.input_names)]
    return _describe_signals(model, (*outputs, *inputs))


def _describe_signals(model: "CoupledModel", names: Sequence[str]) -> str:
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


def coupled_text(model: "CoupledModel") -> str:
    """Write one line per output, and one that states the signals, unless they are those of the record."""
    statement = coupled_signals(model)
    return f"{coupled_equation(model)}\nwhere {statement}" if statement else coupled_equation(model)


def coupled_latex(model: "CoupledModel") -> str:
    """Write the equations as a LaTeX environment ``aligned`` without dollar signs."""
    rows = [
        _name_leaves(
            r"([yu])_\{(?:(\d+),)?k(?=[-}])",
            "{0}_{{{1}k",
            "{},",
            latex_equation(single, statement=""),
            model,
            place,
        )
        for place, single in enumerate(model.models)
    ]
    rows = [row.replace(" = ", " &= ", 1) for row in rows]
    if statement := _describe_symbols(model):
        rows.append(rf"& {latex_statement(statement)}")
    lines = " \\\\\n".join(rows)
    return f"\\begin{{aligned}}\n{lines}\n\\end{{aligned}}"


def coupled_mathml(model: "CoupledModel") -> str:
    """Write one ``math`` element per output, which browsers render without a library.

    The last elements state the signals, unless they are those of the record.
    """
    leaf = r"<mi>([yu])</mi><mrow>(?:<mn>(\d+)</mn><mo>,</mo>)?<mi>k</mi>"
    equations = [
        _name_leaves(
            leaf,
            "<mi>{0}</mi><mrow>{1}<mi>k</mi>",
            "<mn>{}</mn><mo>,</mo>",
            mathml_equation(single, statement=""),
            model,
            place,
        )
        for place, single in enumerate(model.models)
    ]
    stated = mathml_statement(_describe_symbols(model))
    return "\n".join([*equations, *(f'<math display="block">{row}</math>' for row in stated)])


def _describe_symbols(model: "CoupledModel") -> str:
    return _describe_signals(model, (*output_signals(model), *input_signals(model)))


def _name_leaves(pattern: str, leaf: str, index: str, text: str, model: "CoupledModel", place: int) -> str:
    """Replace the signals of one equation by those of the coupled model."""
    names = equation_signals(model, place)

    def name(found: re.Match[str]) -> str:
        signal = names[f"{found[1]}{found[2] or ''}"]
        return leaf.format(signal[0], index.format(signal[1:]) if signal[1:] else "")

    return re.sub(pattern, name, text)
