"""Drag of a turbulent flow: - c |x'| x'."""

import numpy as np

from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.effects.rates import rate_of
from islands.discrepancy.parameter import Parameter


def _form(_x: Signal, rate: Signal, values: Signal, _scene: Scene) -> Signal:
    return -values[0] * np.abs(rate) * rate


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "c",
            f"{scene.output_unit} s^2/{scene.input_unit}^2",
            0.0,
            0.01 * scene.output_peak / rate_of(scene) ** 2,
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.output_peak / rate_of(scene) ** 2,),)


EFFECT = Effect(
    name="quadratic-drag",
    family="shape",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
)
