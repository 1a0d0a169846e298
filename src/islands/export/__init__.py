"""Export of models to text formats, programming languages and blocks of simulators.

Each text format is an entry of `EXPORTS`, each binary one of `FILE_EXPORTS`. All
programs are written from the `Block` of a model.
"""

from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from types import MappingProxyType
from typing import TypeAlias, TypeVar

from islands.errors import IslandsError, ModelError, SettingsError, lookup
from islands.export.fmu import fmu2, fmu3
from islands.export.languages.c import c_source, s_function_source
from islands.export.languages.matlab import matlab_source, matlab_system_source
from islands.export.languages.modelica import modelica_source
from islands.export.languages.python import python_source
from islands.models.block import Block
from islands.models.coupled_narx import CoupledModel
from islands.models.measured_signals import program_block
from islands.models.protocol import DynamicModel
from islands.persistence.models import model_json
from islands.progress import explain_failure

#: Models that can be exported.
Exported: TypeAlias = DynamicModel | CoupledModel

Text = TypeVar("Text", str, bytes)


def plain_text(model: Exported) -> str:
    """Return the equation of a model; a last line states its signals, unless they are those of the record."""
    return model.equation().plain


def latex(model: Exported) -> str:
    """Return the equation of a model in LaTeX, without dollar signs."""
    return model.equation().latex


def mathml(model: Exported) -> str:
    """Return the equation of a model as ``math`` elements, which browsers render without a library."""
    return model.equation().mathml


def _of_block(write: Callable[[Block], Text]) -> Callable[[Exported], Text]:
    """Return a format of models, with the description of that of blocks."""

    @wraps(write)
    def write_model(model: Exported) -> Text:
        return write(program_block(model))

    return write_model


#: Format of model files, which also have the uncertainty of a model of a result.
MODEL_FILE = "json"

#: Text formats by name. Equations may be in deviations; programs have the offsets in their equations.
EXPORTS: Mapping[str, Callable[[Exported], str]] = MappingProxyType(
    {
        "plain": plain_text,
        "latex": latex,
        "mathml": mathml,
        "python": _of_block(python_source),
        "c": _of_block(c_source),
        "matlab": _of_block(matlab_source),
        "matlab-system": _of_block(matlab_system_source),
        "s-function": _of_block(s_function_source),
        "modelica": _of_block(modelica_source),
        MODEL_FILE: model_json,
    }
)

#: Formats that are not text.
FILE_EXPORTS: Mapping[str, Callable[[Exported], bytes]] = MappingProxyType(
    {"fmu": _of_block(fmu3), "fmu2": _of_block(fmu2)}
)


def export(model: Exported, kind: str) -> str:
    """Return a model as text in a format of ``EXPORTS``.

    Raises
    ------
    SettingsError
        The format is unknown or is not text.
    ModelError
        The export fails.
    """
    if kind in FILE_EXPORTS:
        raise SettingsError(f"the format {kind} is not text: write a file with --out or write_export")
    lookup({**EXPORTS, **FILE_EXPORTS}, kind, "format")
    return _write(EXPORTS, kind, model)


def _write(formats: Mapping[str, Callable[[Exported], Text]], kind: str, model: Exported) -> Text:
    try:
        return formats[kind](model)
    except IslandsError:
        raise
    except Exception as error:
        reason = explain_failure(error)
        raise ModelError(f"the export as {kind} is not computed ({reason}): take another format") from error


def write_export(model: Exported, kind: str, path: str | Path) -> None:
    """Write a model to a file in one of its text formats or a format of ``FILE_EXPORTS``.

    Raises
    ------
    SettingsError
        The format is unknown.
    ModelError
        The export fails.
    """
    if kind in FILE_EXPORTS:
        Path(path).write_bytes(_write(FILE_EXPORTS, kind, model))
        return
    Path(path).write_text(f"{export(model, kind).rstrip()}\n", encoding="utf-8")


def export_or_write(model: Exported, kind: str, path: str | Path | None) -> str | None:
    """Return a model as text, or write it to a file if there is a path; see `export` and `write_export`."""
    if path is None:
        return export(model, kind)
    write_export(model, kind, path)
    return None


def return_or_write(text: str, path: str | Path | None) -> str | None:
    """Return a text, or write it to a file if there is a path."""
    if path is None:
        return text
    Path(path).write_text(text, encoding="utf-8")
    return None
