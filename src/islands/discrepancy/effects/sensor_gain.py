"""The sensor's gain is off: (1 + k) y."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, _scene: Scene) -> Signal:
    return (1.0 + values[0]) * y


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("k", "", 0.0, 0.01, -0.5, 0.5),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02,),)


EFFECT = Effect(
    name="sensor-gain",
    family="scale",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Doebelin, Measurement Systems, section 3",
    gain=True,
)
