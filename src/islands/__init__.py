"""Finds the equation behind measured data.

>>> import islands
>>> record = islands.read_record("piezo.csv", inputs=["u_V"], output="y_um")  # doctest: +SKIP
>>> result = islands.fit(record)  # doctest: +SKIP
>>> result.best.equation  # doctest: +SKIP
"""

from islands.data.dataset import Dataset, join
from islands.data.split import Split, split
from islands.errors import IslandsError, ModelError, RecordError, SettingsError
from islands.fit import fit
from islands.identify import identify
from islands.io.models import read_model, write_model
from islands.io.records import read_record, write_record
from islands.model.model import Model, model_of
from islands.model.parsing import parse
from islands.model.primitives import PRIMITIVES, primitive
from islands.result import FittedModel, Result, simulate

__all__ = [
    "PRIMITIVES",
    "Dataset",
    "FittedModel",
    "IslandsError",
    "Model",
    "ModelError",
    "RecordError",
    "Result",
    "SettingsError",
    "Split",
    "fit",
    "identify",
    "join",
    "model_of",
    "parse",
    "primitive",
    "read_model",
    "read_record",
    "simulate",
    "split",
    "write_model",
    "write_record",
]
