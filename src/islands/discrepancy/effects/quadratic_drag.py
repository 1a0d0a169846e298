"""Drag of a turbulent flow: - c |x'| x'."""

from typing import Any

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Element, Scene, Signal, Site


def _force(_x: float, rate: float, _z: float, c: Any) -> float:
    return c[0] * abs(rate) * rate


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    frame = scene.frame
    unit = f"{frame.force_unit} s^2/{frame.unit}^2"
    return (Parameter("c", unit, 0.0, 0.01 * frame.force / frame.rate**2, frame.least),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.frame.force / scene.frame.rate**2,),)


EFFECT = Effect(
    name="quadratic-drag",
    family="shape",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=Element(_force, dissipative=True),
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
)
