"""The amplifier's gain is off: (1 + k) u."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(u: Signal, values: Signal, _scene: Scene) -> Signal:
    return (1.0 + values[0]) * u


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("k", "", 0.0, 0.01, -0.5, 0.5),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02,),)


EFFECT = Effect(
    name="input-gain",
    family="scale",
    site=Site.INPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Doebelin, Measurement Systems, section 3",
    gain=True,
)
