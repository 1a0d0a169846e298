"""Documents that results, models, diagnoses and extended simulations are opened from."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from islands.errors import ModelError
from islands.estimation.estimator_table import Criterion
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.models.coupled_narx import AnyModel
from islands.persistence.models import read_model, terms_document

#: Files and folders that can be opened, for messages.
KINDS = (
    "a result folder, a model file, the folder of a diagnosis, an extended.json, ode:FILE.toml, "
    "fmu:FILE.fmu, or published:12, :13, :14"
)

#: Files that say what a folder holds; the first one that exists counts.
_FILES = ("discrepancy.json", "extended.json", "result.json")

#: Schema of the document of a result, without its version.
RESULT = "islands.result"


@dataclass(frozen=True, slots=True)
class SavedDocument:
    """JSON document of a result, a model, a diagnosis or an extended simulation.

    Attributes
    ----------
    file : Path
    schema : str
        Schema without its version, for example ``islands.result``; empty if there is none.
    content : mapping
    """

    file: Path
    schema: str
    content: Mapping[str, Any]


def open_document(path: str | Path) -> SavedDocument:
    """Read the document of a file, or the one that says what a folder holds.

    Raises
    ------
    ModelError
        There is no such file, or it is no JSON; the message lists the kinds.
    """
    file = _find_file(Path(path))
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ModelError(f"{file} cannot be read ({error}): give {KINDS}") from error
    if not isinstance(content, dict):
        content = {}
    schema = str(content.get("schema", "islands.model/1" if "terms" in content else ""))
    return SavedDocument(file, schema.partition("/")[0], content)


def _find_file(path: Path) -> Path:
    if path.is_dir():
        found = [path / name for name in _FILES if (path / name).is_file()]
        if not found:
            raise ModelError(f"{path} has no {', '.join(sorted(_FILES))}: give {KINDS}")
        return found[0]
    if not path.is_file():
        raise ModelError(f"there is no file or folder {path}: give {KINDS}")
    return path


def read_saved_model(
    saved: SavedDocument, primitives: Mapping[str, Primitive] = PRIMITIVES
) -> AnyModel | None:
    """Read the model of a model file, or the recommended model of a result.

    A result itself has the settings and the bands of its search as well, whose classes import the search.

    Parameters
    ----------
    saved : SavedDocument
    primitives : mapping
        Primitives that expressions may contain.

    Returns
    -------
    DynamicModel, CoupledModel or None
        None if the document is that of a diagnosis, of a simulation, or of neither.

    Raises
    ------
    ModelError
        The document is damaged, or a model file of a result was changed.
    """
    match saved.schema:
        case "islands.model":
            return read_model(saved.file, primitives)
        case "islands.result":
            try:
                entry = find_recommended(saved.content)
            except (KeyError, TypeError, IndexError) as error:
                raise ModelError(f"{saved.file} is damaged: {error!r} is missing or wrong") from error
            return read_listed_model(saved.file.parent, entry, primitives)
    return None


def find_recommended(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the entry of the recommended model in ``result.json``."""
    entry: Mapping[str, Any] = result["models"][result["recommended"]["rank"] - 1]
    return entry


def read_listed_model(
    folder: Path, entry: Mapping[str, Any], primitives: Mapping[str, Primitive] = PRIMITIVES
) -> AnyModel:
    """Read the model file of an entry of ``result.json``.

    Raises
    ------
    ModelError
        The file is not the model of the entry.
    """
    path = folder / "models" / f"{entry['rank']:02d}.json"
    model = read_model(path, primitives)
    written, expected = (
        [(term["regressor"], term["parameter"]) for term in terms]
        for terms in (terms_document(model), entry["terms"])
    )
    if written != expected:
        raise ModelError(
            f"{path} is not the model of {folder / 'result.json'}, whose errors and bands belong to another: "
            "give a changed model as a file outside of the folder"
        )
    return model


def read_shooting_interval(document: Mapping[str, Any]) -> int:
    """Return the steps of the models of a result in an interval of multiple shooting."""
    return int(document["preprocessing"]["shooting_interval"])


def read_criterion(entry: Mapping[str, Any]) -> Criterion | None:
    """Return the error that the parameters of a model minimise; None if its entry does not state it."""
    found = entry["criterion"]
    return None if found is None else Criterion(found["estimator"], found["interval"])
