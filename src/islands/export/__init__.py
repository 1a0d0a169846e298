"""Export of models to text formats, programming languages and blocks of simulators.

Each text format is an entry of `EXPORTS`, each binary one of `FILE_EXPORTS`. Read `block` first: all programs
are written from it.
"""

from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from types import MappingProxyType

from islands.errors import SettingsError, lookup
from islands.export.fmu.archive import fmu2, fmu3
from islands.export.languages.c import c_source
from islands.export.languages.matlab import matlab_source
from islands.export.languages.matlab_system import matlab_system_source
from islands.export.languages.modelica import modelica_source
from islands.export.languages.python import python_source
from islands.export.languages.s_function import s_function_source
from islands.io.coupled_models import coupled_json, coupled_latex, coupled_mathml, coupled_text
from islands.io.models import model_json
from islands.models.coupled_narx import CoupledModel, measured_coupled_model
from islands.models.equations import latex_equation, mathml_equation, plain_text
from islands.models.narx import Model, measured_model


def _choose(
    of_one: Callable[[Model], str], of_several: Callable[[CoupledModel], str]
) -> Callable[[Model | CoupledModel], str]:
    """Return a format of models of one or several outputs, with the description of that of one."""

    @wraps(of_one)
    def write(model: Model | CoupledModel) -> str:
        return of_several(model) if isinstance(model, CoupledModel) else of_one(model)

    return write


#: Text formats by name.
EXPORTS: Mapping[str, Callable[[Model | CoupledModel], str]] = MappingProxyType(
    {
        "plain": _choose(plain_text, coupled_text),
        "latex": _choose(latex_equation, coupled_latex),
        "mathml": _choose(mathml_equation, coupled_mathml),
        "python": python_source,
        "c": c_source,
        "matlab": matlab_source,
        "matlab-system": matlab_system_source,
        "s-function": s_function_source,
        "modelica": modelica_source,
        "json": _choose(model_json, coupled_json),
    }
)

#: Formats that write the equation of a model in deviations. Programs have the offsets in the equation.
_OF_DEVIATIONS = ("plain", "latex", "mathml", "json")

#: Formats that are not text.
FILE_EXPORTS: Mapping[str, Callable[[Model | CoupledModel], bytes]] = MappingProxyType(
    {"fmu": fmu3, "fmu2": fmu2}
)


def export(model: Model | CoupledModel, kind: str) -> str:
    """Return a model of one or several outputs as text in a format of ``EXPORTS``.

    Raises
    ------
    SettingsError
        The format is unknown or is not text.
    """
    if kind in FILE_EXPORTS:
        raise SettingsError(f"the format {kind} is not text: write a file with --out or write_export")
    lookup({**EXPORTS, **FILE_EXPORTS}, kind, "format")
    return EXPORTS[kind](model if kind in _OF_DEVIATIONS else _measure(model))


def write_export(model: Model | CoupledModel, kind: str, path: str | Path) -> None:
    """Write a model to a file in one of its text formats or a format of ``FILE_EXPORTS``.

    Raises
    ------
    SettingsError
        The format is unknown.
    """
    if kind in FILE_EXPORTS:
        Path(path).write_bytes(FILE_EXPORTS[kind](_measure(model)))
        return
    Path(path).write_text(f"{export(model, kind).rstrip()}\n", encoding="utf-8")


def export_or_write(model: Model | CoupledModel, kind: str, path: str | Path | None) -> str | None:
    """Return a model as text, or write it to a file if there is a path; see `export` and `write_export`."""
    if path is None:
        return export(model, kind)
    write_export(model, kind, path)
    return None


def _measure(model: Model | CoupledModel) -> Model | CoupledModel:
    """Return the model of the measured signals, with the offsets in its equation."""
    return measured_coupled_model(model) if isinstance(model, CoupledModel) else measured_model(model)
