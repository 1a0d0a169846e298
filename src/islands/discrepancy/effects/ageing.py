"""The gain drifts: gain (1 + k t / T) over the record's duration T."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("ageing", "", 0.0, 0.01, -0.9, 2.0),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02,),)


EFFECT = Effect(
    name="ageing",
    family="change",
    site=Site.CORE,
    parameters=_parameters,
    grid=_grid,
    form=None,
    source="Doebelin, Measurement Systems, section 3",
)
