"""Dry friction: - F sign(x')."""

from math import tanh
from typing import Any

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Element, Scene, Signal, Site


def _force(_x: float, rate: float, _z: float, numbers: Any) -> float:
    # Smooth within a part of the usual rate: a step would have no derivative.
    return numbers[0] * tanh(rate / numbers[1])


def _turning(scene: Scene) -> tuple[float, ...]:
    return (scene.frame.sharp * scene.frame.rate,)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    frame = scene.frame
    return (Parameter("F", frame.force_unit, 0.0, 0.005 * frame.force, frame.least),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.01 * scene.frame.force,),)


EFFECT = Effect(
    name="coulomb-friction",
    family="memory",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=Element(_force, constants=_turning, dissipative=True),
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, 1994",
)
