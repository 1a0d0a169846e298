"""Toy class of models, as a contributor adds it: a first-order lag with a gain that follows its input."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from islands.data.dataset import Dataset
from islands.models.parametric import ParametricModel


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
