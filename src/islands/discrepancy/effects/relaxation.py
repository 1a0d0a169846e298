"""The hysteretic state decays: - h / tau in h'."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("relaxation", "1/s", 0.0, 0.05, -0.05, 10.0),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.1,), (1.0,))


EFFECT = Effect(
    name="relaxation",
    family="memory",
    site=Site.CORE,
    parameters=_parameters,
    grid=_grid,
    form=None,
    source="Bouc-Wen models with relaxation; Ikhouane and Rodellar, Systems with Hysteresis, section 2",
)
