"""The amplifier saturates: u is cut off a part of its peak below it."""

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(u: Signal, values: Signal, scene: Scene) -> Signal:
    level = scene.input_peak * (1.0 - max(values[0], 0.0))
    return np.clip(u, -level, level)


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("cut", "", 0.0, 0.02, 0.0, 0.8),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((cut,) for cut in (0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5))


EFFECT = Effect(
    name="input-saturation",
    family="shape",
    site=Site.INPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    linear=0,
)
