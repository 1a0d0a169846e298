"""Dry friction: - F sign(x')."""

import numpy as np

from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.effects.rates import rate_of
from islands.discrepancy.parameter import Parameter

#: Part of the usual rate within which the force turns.
_SMOOTH = 0.005


def _form(_x: Signal, rate: Signal, values: Signal, scene: Scene) -> Signal:
    # Smooth within a part of the usual rate: a step would have no derivative.
    return -values[0] * np.tanh(rate / (_SMOOTH * rate_of(scene)))


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("F", scene.output_unit, 0.0, 0.005 * scene.output_peak),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.01 * scene.output_peak,),)


EFFECT = Effect(
    name="coulomb-friction",
    family="memory",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, 1994",
)
