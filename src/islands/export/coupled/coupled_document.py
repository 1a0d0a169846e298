"""Files of coupled models: JSON with one model document per output."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from islands.errors import ModelError
from islands.export.coupled.coupled_equations import coupled_equation, coupled_latex
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.io.models import model_from_json, model_json, write_model_text
from islands.simulation.coupled_model import CoupledModel

COUPLED_SCHEMA = "islands.coupled-model/1"


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
