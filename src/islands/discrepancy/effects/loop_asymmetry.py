"""The loop is not symmetric: - delta |u'| |h| in h'."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "loop-asymmetry",
            f"1/{scene.input_unit}",
            0.0,
            0.02 / scene.input_peak,
            -0.35 / scene.input_peak,
            0.35 / scene.input_peak,
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.04 / scene.input_peak,),)


EFFECT = Effect(
    name="loop-asymmetry",
    family="memory",
    site=Site.CORE,
    parameters=_parameters,
    grid=_grid,
    form=None,
    source="Wang and Wen, Parameter estimation of Bouc-Wen with asymmetry, 1998",
)
