"""The output is measured from another zero: y + c."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, _scene: Scene) -> Signal:
    return y + values[0]


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("c", scene.output_unit, 0.0, 0.01 * scene.output_peak),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.01 * scene.output_peak,),)


EFFECT = Effect(
    name="offset",
    family="baseline",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Doebelin, Measurement Systems, section 3",
)
