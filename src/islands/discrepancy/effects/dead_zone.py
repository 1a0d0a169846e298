"""Nothing happens around zero: u is smaller by d, and zero below it."""

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site

#: Part of its peak within which an input has to come to zero.
_NEAR = 0.05


def _form(u: Signal, values: Signal, _scene: Scene) -> Signal:
    return np.sign(u) * np.maximum(np.abs(u) - values[0], 0.0)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "d",
            scene.input_unit,
            0.0,
            0.005 * scene.input_peak,
            -0.2 * scene.input_peak,
            0.3 * scene.input_peak,
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((part * scene.input_peak,) for part in (0.0075, 0.025, 0.075))


def _crossed(scene: Scene) -> bool:
    # Of an input that is never near zero nobody can say more than that it is smaller.
    return float(np.min(np.abs(scene.u))) < _NEAR * scene.input_peak


EFFECT = Effect(
    name="dead-zone",
    family="shape",
    site=Site.INPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    applies=_crossed,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
)
