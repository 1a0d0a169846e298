"""The loop's shape changes with the rate: beta, gamma (1 + k |u'|)."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "rate-dependent-loop",
            f"s/{scene.input_unit}",
            0.0,
            0.05 / scene.frame.rate,
            -0.6 / scene.frame.rate,
            5.0 / scene.frame.rate,
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.1 / scene.frame.rate,),)


EFFECT = Effect(
    name="rate-dependent-loop",
    family="memory",
    site=Site.CORE,
    parameters=_parameters,
    grid=_grid,
    form=None,
    source="Al Janaideh et al., generalized rate-dependent hysteresis models, 2009",
)
