"""The sensor adds a part of the absolute value: y + k |y|."""

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, _scene: Scene) -> Signal:
    return y + values[0] * np.abs(y)


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("k", "", 0.0, 0.01, -0.8, 0.8),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02,),)


EFFECT = Effect(
    name="absolute-value-sensor",
    family="shape",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Doebelin, Measurement Systems, section 3",
)
