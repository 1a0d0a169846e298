"""Toy class of models, as a contributor adds it: a first-order lag with a gain that follows its input."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from islands.models.parametric import ParametricModel
from islands.persistence import models
from islands.records.dataset import Dataset


@dataclass(frozen=True, kw_only=True)
class GainScheduledModel(ParametricModel):
    """First-order lag x of an input times a gain that depends on the input; the output is x above a level."""

    kind: ClassVar[str] = "gain-scheduled"
    summary: ClassVar[str] = "First-order lag with a gain that depends on the input."
    names: ClassVar[tuple[str, ...]] = ("pole", "gain", "slope", "level")
    states: ClassVar[tuple[str, ...]] = ("x1",)
    starts: ClassVar[tuple[str, ...]] = ("y(k) - level",)

    def right_sides(self) -> Mapping[str, str]:
        """Return the equations of the output and of the state."""
        return {
            "y": "x1(k) + level",
            "x1": "pole*x1(k-1) + (1 - pole)*(gain + slope*u(k-1))*u(k-1)",
        }

    @classmethod
    def start(cls, record: Dataset) -> Iterable["GainScheduledModel"]:
        """Yield a fast and a slow lag with the gain of the ranges of the record."""
        gain = float(np.ptp(record.y) / (np.ptp(record.u) or 1.0))
        for samples in (3.0, 30.0):
            yield cls.of_record(record, (np.exp(-1.0 / samples), gain, 0.0, float(record.y.mean())))


#: Parameters of the records, in the order of the class.
TRUE = (0.9, 2.0, -0.4, 10.0)


def add_class(monkeypatch) -> None:
    """Add the class to the table, as an entry of ``MODEL_CLASSES`` does."""
    monkeypatch.setitem(models._CLASSES, GainScheduledModel.kind, GainScheduledModel)


def make_record(samples: int = 600, noise: float = 0.01, disturbance: float = 0.0, seed: int = 0) -> Dataset:
    """Make a record of the system at held levels of its input, with a sine of 30 s on its output."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.uniform(0.0, 2.0, samples // 15 + 1), 15)[:samples]
    pole, gain, slope, level = TRUE
    x = np.zeros(samples)
    for k in range(1, samples):
        x[k] = pole * x[k - 1] + (1.0 - pole) * (gain + slope * u[k - 1]) * u[k - 1]
    y = x + level + noise * rng.standard_normal(samples)
    y += disturbance * np.sin(2.0 * np.pi * 0.5 * np.arange(samples) / 30.0)
    return Dataset(u, y, 0.5, ("u_V",), "y_K")
