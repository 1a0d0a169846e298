"""The input acts in slips: it moves only beyond a breakaway distance."""

import numpy as np

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site
from islands.systems.hysteresis_operators import slider


def _form(u: Signal, values: Signal, _scene: Scene) -> Signal:
    if values[0] <= 0.0:
        return u
    moved = np.empty_like(u)
    slider(u, values[0], moved)
    return moved


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter("breakaway", scene.input_unit, 0.0, 0.005 * scene.input_peak, 0.0, 0.3 * scene.input_peak),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    # It changes by leaps, so that no derivative leads to the best one: a fine grid has to.
    return tuple((float(part) * scene.input_peak,) for part in np.geomspace(0.005, 0.3, 24))


EFFECT = Effect(
    name="stiction",
    family="memory",
    site=Site.INPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Choudhury, Thornhill and Shah, Modelling valve stiction, 2005",
    linear=0,
)
