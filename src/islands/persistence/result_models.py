"""What readers need of ``result.json``: outputs, shooting, criterion, preprocessing."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from islands.errors import ModelError
from islands.estimation.estimator_table import Criterion
from islands.records.preprocessing_steps import Preprocessing


def check_single_output(document: Mapping[str, Any], folder: Path) -> None:
    """Check that ``result.json`` is the result of one output.

    Raises
    ------
    ModelError
        It is a result of several outputs; the message names their folders.
    """
    if str(document.get("schema", "")).startswith("islands.coupled-result/"):
        raise ModelError(
            f"{folder} has a model of several outputs, which islands.load and read_coupled_model open: give "
            f"the result of one output, as {folder / 'outputs' / '1-NAME'}"
        )


def read_shooting_interval(document: Mapping[str, Any]) -> int:
    """Return the steps of the models of a result in an interval of multiple shooting."""
    # Results of earlier versions had intervals of as many means as the setting has samples.
    preprocessing = document.get("preprocessing", {})
    return int(preprocessing.get("shooting_interval", document["settings"]["shooting"]))


def read_criterion(entry: Mapping[str, Any]) -> Criterion | None:
    """Return the error that the parameters of a model minimise; None if its entry does not state it."""
    # Results of earlier versions have no criterion.
    found = entry.get("criterion")
    return None if found is None else Criterion(found["estimator"], found["interval"])


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
