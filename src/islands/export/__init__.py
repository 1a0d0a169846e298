"""Export of models to text formats, programming languages and blocks of simulators.

Each text format is an entry of `EXPORTS`, each binary one of `FILE_EXPORTS`. Read `parts` first:
all programs share them.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

from islands.errors import SettingsError, lookup
from islands.export.coupled import export_coupled
from islands.export.fmu.archive import fmu2, fmu3
from islands.export.languages.c import c_source
from islands.export.languages.matlab import matlab_source
from islands.export.languages.matlab_system import matlab_system_source
from islands.export.languages.modelica import modelica_source
from islands.export.languages.python import python_source
from islands.export.languages.s_function import s_function_source
from islands.io.models import model_json
from islands.model.equations import latex_equation, mathml_equation, plain_text
from islands.model.model import Model, measured_model
from islands.simulation.coupled_model import CoupledModel, measured_coupled_model

EXPORTS: Mapping[str, Callable[[Model], str]] = MappingProxyType(
    {
        "plain": plain_text,
        "latex": latex_equation,
        "mathml": mathml_equation,
        "python": python_source,
        "c": c_source,
        "matlab": matlab_source,
        "matlab-system": matlab_system_source,
        "s-function": s_function_source,
        "modelica": modelica_source,
        "json": model_json,
    }
)

#: Formats that write the equation of a model in deviations. Programs have the offsets in the equation.
_OF_DEVIATIONS = ("plain", "latex", "mathml", "json")

#: Formats that are not text.
FILE_EXPORTS: Mapping[str, Callable[[Model | CoupledModel], bytes]] = MappingProxyType(
    {"fmu": fmu3, "fmu2": fmu2}
)


def export(model: Model | CoupledModel, kind: str) -> str:
    """Return a model as text in a format of ``EXPORTS``, or of ``COUPLED_EXPORTS`` for several outputs.

    Raises
    ------
    SettingsError
        The format is unknown or is not text.
    """
    if kind in FILE_EXPORTS:
        raise SettingsError(f"the format {kind} is not text: write a file with --out or write_export")
    if isinstance(model, CoupledModel):
        return export_coupled(model if kind in _OF_DEVIATIONS else measured_coupled_model(model), kind)
    lookup({**EXPORTS, **FILE_EXPORTS}, kind, "format")
    return EXPORTS[kind](model if kind in _OF_DEVIATIONS else measured_model(model))


def write_export(model: Model | CoupledModel, kind: str, path: str | Path) -> None:
    """Write a model to a file in one of its text formats or a format of ``FILE_EXPORTS``.

    Raises
    ------
    SettingsError
        The format is unknown.
    """
    if kind in FILE_EXPORTS:
        written = measured_coupled_model(model) if isinstance(model, CoupledModel) else measured_model(model)
        Path(path).write_bytes(FILE_EXPORTS[kind](written))
        return
    Path(path).write_text(f"{export(model, kind).rstrip()}\n", encoding="utf-8")
