"""Simulations by name, as the command line and REST ask for them: ``bouc-wen-piezo``, ``model:FILE``, ..."""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from islands.data.dataset import Dataset
from islands.discrepancy.core import Core
from islands.discrepancy.cores.bouc_wen_piezo import BoucWenPiezoCore
from islands.discrepancy.cores.column import ColumnCore
from islands.discrepancy.cores.narx import NarxCore
from islands.errors import ModelError, SettingsError, chosen
from islands.io.models import read_model
from islands.systems.bouc_wen import BoucWenPiezo


def simulation(spec: str, record: Dataset, columns: Mapping[str, Any] | None = None) -> Core:
    """Return the simulation that a text asks for.

    Parameters
    ----------
    spec : str
        A name of `SIMULATIONS`, and behind a colon what it needs.
    record : Dataset
        What it will be held against.
    columns : mapping, optional
        Columns of the record's file that a simulation may be, by name: ``(samples,)`` each.

    Raises
    ------
    SettingsError, ModelError
        The text asks for nothing that there is.
    """
    name, _, rest = spec.partition(":")
    return chosen(SIMULATIONS, name, "simulation")(rest, record, columns or {})


def column_of(spec: str) -> str | None:
    """Return the column that a text asks for as the simulation; None where it asks for none."""
    name, _, rest = spec.partition(":")
    return rest if name == "column" else None


def _piezo(path: str, _record: Dataset, _columns: Mapping[str, Any]) -> Core:
    if not path:
        return BoucWenPiezoCore()
    given = _parameters(path, tuple(field.name for field in fields(BoucWenPiezo)))
    return BoucWenPiezoCore(replace(BoucWenPiezo(), **given))


def _model(path: str, record: Dataset, _columns: Mapping[str, Any]) -> Core:
    model = read_model(path)
    if model.dt is not None and abs(model.dt - record.dt) > 1e-3 * record.dt:
        raise SettingsError(
            f"{path} was identified at {model.dt:g} s, the record is sampled at {record.dt:g} s: give a "
            "model and a record of one sampling time"
        )
    if model.theta is None:
        raise ModelError(f"{path} has no parameters: estimate them first")
    return NarxCore(model, f"model {Path(path).name}", record.y[: model.maximum_lag])


def _column(name: str, _record: Dataset, columns: Mapping[str, Any]) -> Core:
    return ColumnCore(f"column {name}", chosen(columns, name, "column"))


def _parameters(path: str, names: tuple[str, ...]) -> dict[str, float]:
    """Read a file of parameters: a JSON object of numbers."""
    try:
        given = json.loads(Path(path).read_text())
    except (OSError, ValueError) as error:
        raise SettingsError(f"{path} cannot be read as JSON ({error}): give an object of numbers") from error
    if not isinstance(given, dict) or not all(isinstance(value, int | float) for value in given.values()):
        example = json.dumps(dict.fromkeys(names, 1.0))
        raise SettingsError(f"{path} is no object of numbers: write one like {example}")
    if unknown := given.keys() - set(names):
        known = ", ".join(names)
        raise SettingsError(f"{path} names {', '.join(sorted(unknown))}: the parameters are {known}")
    return {name: float(value) for name, value in given.items()}


#: What makes a simulation of the text behind its name's colon; a new one is one entry here.
SIMULATIONS: Mapping[str, Callable[[str, Dataset, Mapping[str, Any]], Core]] = MappingProxyType(
    {"bouc-wen-piezo": _piezo, "model": _model, "column": _column}
)
