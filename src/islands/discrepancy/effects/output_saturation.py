"""The sensor ends a part of the output's peak below it."""

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    level = scene.output_peak * (1.0 - max(values[0], 0.0))
    return np.clip(y, -level, level) if values[0] > 0.0 else y


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("cut", "", 0.0, 0.02, 0.0, 0.8),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((cut,) for cut in (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5))


EFFECT = Effect(
    name="output-saturation",
    family="shape",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Doebelin, Measurement Systems, section 3",
    linear=0,
)
