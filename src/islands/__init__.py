"""Finds the equation behind measured data.

>>> import islands
>>> record = islands.read_record("piezo.csv", inputs=["u_V"], output="y_um")  # doctest: +SKIP
>>> result = islands.fit(record)  # doctest: +SKIP
>>> result.best.equation  # doctest: +SKIP
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from islands.data.dataset import Dataset, join
    from islands.data.split import Split, split
    from islands.discrepancy.diagnosis import Diagnosis
    from islands.discrepancy.effects import EFFECTS
    from islands.discrepancy.interfaces.context import Parameter
    from islands.discrepancy.interfaces.effect import Effect, Site
    from islands.errors import IslandsError, ModelError, RecordError, SettingsError
    from islands.facade.diagnose import diagnose
    from islands.facade.fit import fit
    from islands.facade.identify import identify
    from islands.facade.result import FittedModel, Result, simulate
    from islands.io.models import read_model, write_model
    from islands.io.records import read_record, write_record
    from islands.io.simulator_spec.factory import simulated
    from islands.model.model import Model, model_of
    from islands.model.parsing import parse
    from islands.model.primitives import PRIMITIVES, primitive

__all__ = [
    "EFFECTS",
    "PRIMITIVES",
    "Dataset",
    "Diagnosis",
    "Effect",
    "FittedModel",
    "IslandsError",
    "Model",
    "ModelError",
    "Parameter",
    "RecordError",
    "Result",
    "SettingsError",
    "Site",
    "Split",
    "diagnose",
    "fit",
    "identify",
    "join",
    "model_of",
    "parse",
    "primitive",
    "read_model",
    "read_record",
    "simulate",
    "simulated",
    "split",
    "write_model",
    "write_record",
]

#: Where the public names live. Each is fetched when it is asked for: a service that accepts a job, or a
#: command that lists them, needs no kernels, whose compiler takes half a second to import.
_HOMES = {
    "data.dataset": ("Dataset", "join"),
    "data.split": ("Split", "split"),
    "facade.diagnose": ("diagnose",),
    "discrepancy.diagnosis": ("Diagnosis",),
    "discrepancy.effects": ("EFFECTS",),
    "discrepancy.interfaces.context": ("Parameter",),
    "discrepancy.interfaces.effect": ("Effect", "Site"),
    "errors": ("IslandsError", "ModelError", "RecordError", "SettingsError"),
    "facade.fit": ("fit",),
    "facade.identify": ("identify",),
    "io.models": ("read_model", "write_model"),
    "io.records": ("read_record", "write_record"),
    "io.simulator_spec.factory": ("simulated",),
    "model.model": ("Model", "model_of"),
    "model.parsing": ("parse",),
    "model.primitives": ("PRIMITIVES", "primitive"),
    "facade.result": ("FittedModel", "Result", "simulate"),
}


def __getattr__(name: str) -> Any:
    if name == "__version__":
        return version("islands")
    for home, names in _HOMES.items():
        if name in names:
            value = globals()[name] = getattr(import_module(f"islands.{home}"), name)
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
