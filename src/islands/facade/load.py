"""`load`: a result, a model, a diagnosis or a simulation, whatever file or folder holds it."""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

from islands.errors import ModelError
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Primitive
from islands.facade.results.fitted_model import FittedModel
from islands.facade.results.identification import Result
from islands.facade.results.reader import read_result
from islands.facade.results.saved_simulation import SavedDiagnosis, SavedSimulation
from islands.persistence.ensembles import bands_of_file
from islands.persistence.models import read_model
from islands.persistence.saved_documents import KINDS, open_document
from islands.simulators.specification.code import FmuSpec
from islands.simulators.specification.equations import OdeSpec
from islands.simulators.specification.table import EXTENDED_FILE, LocalExtendedSpec, parse_spec
from islands.systems.published_models import get_published_model

#: Values of `load`; each has ``simulate`` and ``export``.
Loaded: TypeAlias = Result | FittedModel | SavedSimulation | SavedDiagnosis

#: A JSON object.
_Document: TypeAlias = Mapping[str, Any]


def load(path: str | Path, primitives: Mapping[str, Primitive] = PRIMITIVES) -> Loaded:
    """Open a result, a model, a diagnosis or a simulation, to simulate records with it.

    ``islands simulate`` opens its first argument with this function, so both give the same numbers.

    Parameters
    ----------
    path : str or Path
        A result folder of ``fit`` or ``identify``, of one or several outputs; a model file; the folder of a
        diagnosis, or its ``extended.json``; ``ode:FILE.toml``, ``fmu:FILE.fmu`` or ``published:13``, as on
        the command line.
    primitives : mapping
        Primitives that expressions may contain; add your own with ``PRIMITIVES | {mine.name: mine}``.

    Returns
    -------
    Result, FittedModel, SavedDiagnosis or SavedSimulation
        Each has ``simulate(record)`` and ``export(kind, path)``. A model file of a result folder has the
        errors, the warm-up and the prediction bands of the result.

    Raises
    ------
    ModelError
        There is no such file, it is damaged, or it holds something else; the message lists the kinds.
    """
    kind, _, rest = str(path).partition(":")
    if kind == "published":
        return FittedModel.from_model(get_published_model(rest).model)
    if kind in ("ode", "fmu"):
        return SavedSimulation(_read_equations(str(path)))
    saved = open_document(path)
    reader = _READERS.get(saved.schema)
    if reader is None:
        raise ModelError(f"{saved.file} holds no model, result or simulation: give {KINDS}")
    return reader(saved.file, saved.content, primitives)


def _read_equations(text: str) -> OdeSpec | FmuSpec:
    """Read equations, or an FMU with all names filled in."""
    found = parse_spec(text)
    if isinstance(found, FmuSpec):
        model = found.make_model()
        return FmuSpec.from_system(model, found.make_system(model))
    assert isinstance(found, OdeSpec)
    return found


def _load_result(file: Path, _document: _Document, primitives: Mapping[str, Primitive]) -> Result:
    return read_result(file.parent, primitives)


def _load_model(file: Path, document: _Document, primitives: Mapping[str, Primitive]) -> FittedModel:
    """Read a model file; a model of a result folder has the errors and the bands of the result."""
    folder = file.absolute().parent.parent
    if file.absolute().parent.name == "models" and (folder / "result.json").is_file():
        for each in read_result(folder, primitives).models:
            if f"{each.rank:02d}.json" == file.name:
                return each
    model = read_model(file, primitives)
    return FittedModel.from_model(model, bands_of_file(document, model, primitives))


def _load_extended(file: Path, _document: _Document, _primitives: Mapping[str, Primitive]) -> SavedSimulation:
    return _read_extended(file)


def _read_extended(file: Path) -> SavedSimulation:
    spec = parse_spec(f"model:{file}")
    assert isinstance(spec, LocalExtendedSpec)
    return SavedSimulation(spec)


def _load_diagnosis(file: Path, document: _Document, _primitives: Mapping[str, Primitive]) -> SavedDiagnosis:
    folder = file.parent
    if "verdict" not in document:
        raise ModelError(f"{file} is damaged: it has no verdict. Diagnose again, or give {KINDS}")
    extended = folder / EXTENDED_FILE
    extension = _read_extended(extended) if extended.is_file() else None
    return SavedDiagnosis(folder, MappingProxyType(document), extension)


#: Readers by the schema of the document, without its version.
_READERS: Mapping[str, Callable[[Path, _Document, Mapping[str, Primitive]], Loaded]] = MappingProxyType(
    {
        "islands.result": _load_result,
        "islands.model": _load_model,
        "islands.extended": _load_extended,
        "islands.discrepancy": _load_diagnosis,
    }
)
