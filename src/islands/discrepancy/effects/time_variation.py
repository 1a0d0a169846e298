"""The gain changes at an instant: gain (1 + k) behind it."""

from islands.discrepancy.effects.changes import bounds, instants
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter("gain-step", "", 0.0, 0.01, -0.9, 2.0),
        Parameter("gain-step instant", "s", 0.0, 0.3 * scene.fitted / 45, *bounds(scene)),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((0.02, instant) for instant in instants(scene))


EFFECT = Effect(
    name="gain-step",
    family="change",
    site=Site.CORE,
    parameters=_parameters,
    grid=_grid,
    form=None,
    source="Basseville and Nikiforov, Detection of Abrupt Changes",
    searched=1,
)
