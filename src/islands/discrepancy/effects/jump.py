"""The output's zero jumps: y + c behind an instant."""

from islands.discrepancy.effects.changes import after, bounds, instants
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    return y + values[0] * after(scene, values[1])


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter("c", scene.output_unit, 0.0, 0.01 * scene.output_peak),
        Parameter("instant", "s", 0.0, 0.3 * scene.fitted / 45, *bounds(scene)),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((0.02 * scene.output_peak, instant) for instant in instants(scene))


EFFECT = Effect(
    name="jump",
    family="baseline",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Basseville and Nikiforov, Detection of Abrupt Changes",
    searched=1,
)
