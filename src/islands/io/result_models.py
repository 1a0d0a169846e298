"""Models of a result folder, and how their errors were measured."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from islands.data.preprocessing_steps import Preprocessing
from islands.errors import ModelError


@dataclass(frozen=True, slots=True)
class ErrorMeasurement:
    """Settings of the simulations whose errors are in a result.

    Attributes
    ----------
    warm_up : int or None
        Number of samples before the first prediction. None if the result was written without it.
    shooting : int
        Steps of the model in an interval of multiple shooting.
    """

    warm_up: int | None
    shooting: int


def find_model_file(path: str | Path) -> Path:
    """Return the file of the recommended model of a result folder. Any other path is returned as it is.

    Raises
    ------
    ModelError
        The folder has no ``result.json``, it is damaged, or it is of several outputs.
    """
    path = Path(path)
    if not path.is_dir():
        return path
    result = path / "result.json"
    document = _read_object(result)
    check_single_output(document, path)
    try:
        # Results of earlier versions recommend no model.
        rank = int(document.get("recommended", {"rank": 1})["rank"])
    except (ValueError, KeyError, TypeError) as error:
        raise _damaged(result, error) from error
    return path / "models" / f"{rank:02d}.json"


def check_single_output(document: Mapping[str, Any], folder: Path) -> None:
    """Check that ``result.json`` is the result of one output.

    Raises
    ------
    ModelError
        It is a result of several outputs; the message names their folders.
    """
    if str(document.get("schema", "")).startswith("islands.coupled-result/"):
        raise ModelError(
            f"{folder} has a model of several outputs, which islands simulate, islands show and "
            f"read_coupled_model take: give the result of one output, as {folder / 'outputs' / '1-NAME'}"
        )


def read_error_measurement(model_file: str | Path) -> ErrorMeasurement | None:
    """Return how the errors of a model in a result folder were measured.

    Returns
    -------
    ErrorMeasurement or None
        None if the file is not ``models/NN.json`` of a folder with a ``result.json`` that has this model.

    Raises
    ------
    ModelError
        ``result.json`` is damaged.
    """
    file = Path(model_file).absolute()
    result = file.parent.parent / "result.json"
    if file.parent.name != "models" or not file.stem.isdigit() or not result.is_file():
        return None
    document = _read_object(result)
    try:
        entries = {entry["rank"]: entry for entry in document["models"]}
        entry = entries.get(int(file.stem))
        return entry and ErrorMeasurement(entry.get("warm_up"), read_shooting_interval(document))
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _damaged(result, error) from error


def read_shooting_interval(document: Mapping[str, Any]) -> int:
    """Return the steps of the models of a result in an interval of multiple shooting."""
    # Results of earlier versions had intervals of as many means as the setting has samples.
    preprocessing = document.get("preprocessing", {})
    return int(preprocessing.get("shooting_interval", document["settings"]["shooting"]))


def read_preprocessing(model_file: str | Path) -> Preprocessing | None:
    """Return the steps that the record of a model was preprocessed with; None if there were none.

    Parameters
    ----------
    model_file : str or Path
        File of a model. A file outside of a result folder has no steps.

    Raises
    ------
    ModelError
        ``result.json`` is damaged.
    """
    file = Path(model_file).absolute()
    result = file.parent.parent / "result.json"
    if file.parent.name != "models" or not result.is_file():
        return None
    steps = _read_object(result).get("preprocessing", {}).get("steps")
    try:
        return None if steps is None else Preprocessing.from_document(steps)
    except (ValueError, KeyError, TypeError) as error:
        raise _damaged(result, error) from error


def _read_object(result: Path) -> dict[str, Any]:
    try:
        return dict(json.loads(result.read_text(encoding="utf-8")))
    except FileNotFoundError as error:
        raise ModelError(
            f"{result.parent} has no result.json: give the folder of islands fit or identify, or a model file"
        ) from error
    except (OSError, ValueError, TypeError) as error:
        raise _damaged(result, error) from error


def _damaged(result: Path, error: Exception) -> ModelError:
    return ModelError(f"{result} cannot be read ({error!r}): give the file of a model outside of this folder")
