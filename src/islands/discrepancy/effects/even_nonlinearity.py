"""An even part of the characteristic: + k x^2, of a stiffness on the side of what resists."""

from typing import Any

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Element, Scene, Signal, Site


def _force(x: float, _rate: float, _z: float, k: Any) -> float:
    return k[0] * x * x


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    frame = scene.frame
    return (Parameter("k", f"{frame.force_unit}/{frame.unit}^2", 0.0, 0.01 * frame.force / frame.peak**2),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.frame.force / scene.frame.peak**2,),)


EFFECT = Effect(
    name="even-nonlinearity",
    family="shape",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=Element(_force),
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
)
