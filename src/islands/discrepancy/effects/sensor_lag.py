"""The sensor follows with a time constant: tau y' + y = v."""

from islands.discrepancy.effects.filters import low_pass
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    return low_pass(y, values[0], scene.dt) if values[0] > 0.0 else y


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("tau", "s", 0.0, scene.dt, 0.0, scene.fitted / 4),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.3 * scene.dt,), (2 * scene.dt,), (6 * scene.dt,))


EFFECT = Effect(
    name="sensor-lag",
    family="timing",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Doebelin, Measurement Systems, section 3",
)
