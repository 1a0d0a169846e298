"""Friction that differs between the directions: - c |x'|."""

from typing import Any

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Element, Scene, Signal, Site


def _force(_x: float, rate: float, _z: float, c: Any) -> float:
    return c[0] * abs(rate)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    frame = scene.frame
    return (Parameter("c", f"{frame.force_unit} s/{frame.unit}", 0.0, 0.01 * frame.force / frame.rate),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.frame.force / scene.frame.rate,),)


EFFECT = Effect(
    name="viscous-asymmetry",
    family="memory",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=Element(_force, dissipative=True),
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, 1994",
)
