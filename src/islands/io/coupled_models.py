"""Models of several outputs as text and files: equations, LaTeX, MathML, JSON with one document per output.

Equations have the signals y1, y2, .. for the outputs, and u or u1, u2, .. for the inputs.
"""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from islands.errors import ModelError
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.io.models import model_from_json, model_json, write_model_text
from islands.models.coupled_narx import CoupledModel
from islands.models.equations import (
    latex_equation,
    latex_statement,
    mathml_equation,
    mathml_statement,
    named_equation,
    signal_names,
)
from islands.models.signal_statement import join_statements, symbols

COUPLED_SCHEMA = "islands.coupled-model/1"


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
        name: names[channel]
        for name, channel in zip(symbols(model.models[place].inputs), channels, strict=True)
    }


def coupled_equation(model: CoupledModel) -> str:
    """Write one line per output, with the column names of the record."""
    return "\n".join(named_equation(single) for single in model.models)


def coupled_signals(model: CoupledModel) -> str:
    """State which signals the equations read, with the column names of the record."""
    outputs = (signal_names(single)[0] for single in model.models)
    inputs = signal_names(model.models[0])[1 : 1 + len(model.input_names)]
    return _describe_signals(model, (*outputs, *inputs))


def _describe_signals(model: CoupledModel, names: Sequence[str]) -> str:
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


def coupled_text(model: CoupledModel) -> str:
    """Write one line per output, and one that states the signals, unless they are those of the record."""
    statement = coupled_signals(model)
    return f"{coupled_equation(model)}\nwhere {statement}" if statement else coupled_equation(model)


def coupled_latex(model: CoupledModel) -> str:
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


def coupled_mathml(model: CoupledModel) -> str:
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


def _describe_symbols(model: CoupledModel) -> str:
    return _describe_signals(model, (*output_signals(model), *input_signals(model)))


def _name_leaves(pattern: str, leaf: str, index: str, text: str, model: CoupledModel, place: int) -> str:
    """Replace the signals of one equation by those of the coupled model."""
    names = equation_signals(model, place)

    def name(found: re.Match[str]) -> str:
        signal = names[f"{found[1]}{found[2] or ''}"]
        return leaf.format(signal[0], index.format(signal[1:]) if signal[1:] else "")

    return re.sub(pattern, name, text)


def coupled_json(model: CoupledModel) -> str:
    """Return a coupled model as JSON text. Equal models give equal texts.

    Raises
    ------
    ModelError
        A number of the model is not finite.
    """
    document = {
        "schema": COUPLED_SCHEMA,
        "inputs": list(model.input_names),
        "outputs": list(model.output_names),
        "dt": model.dt,
        "average": model.average,
        "equation": coupled_equation(model),
        "latex": coupled_latex(model),
        "models": [json.loads(model_json(single)) for single in model.models],
    }
    return json.dumps(document, indent=2) + "\n"


def write_coupled_model(model: CoupledModel, path: str | Path) -> None:
    """Write the file of a coupled model.

    Raises
    ------
    ModelError
        A number of the model is not finite, or the file cannot be written.
    """
    write_model_text(coupled_json(model), path)


def read_coupled_model(path: str | Path, primitives: Mapping[str, Primitive] = PRIMITIVES) -> CoupledModel:
    """Read the file of a coupled model, or ``model.json`` of a result folder.

    Parameters
    ----------
    primitives : mapping
        Primitives that expressions may contain; add your own with ``PRIMITIVES | {mine.name: mine}``.

    Raises
    ------
    ModelError
        The file does not exist or is not a coupled model. The message names the invalid field.
    """
    file = _find_file(path)
    document = _read_object(file)
    if document.get("schema") != COUPLED_SCHEMA:
        raise ModelError(f"{file} is not a coupled model of schema {COUPLED_SCHEMA}")
    entries = document.get("models")
    if not isinstance(entries, list):
        raise ModelError(f"{file}: models: there is no list of models")
    return CoupledModel(
        tuple(
            model_from_json(json.dumps(entry), f"{file}: models.{place}", primitives)
            for place, entry in enumerate(entries)
        )
    )


def _find_file(path: str | Path) -> Path:
    path = Path(path)
    return path / "model.json" if path.is_dir() else path


def _read_object(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ModelError(f"cannot read the model file {file}: {error}") from error
    if not isinstance(found, dict):
        raise ModelError(f"{file} does not hold a JSON object")
    return found
