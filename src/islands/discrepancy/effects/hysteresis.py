"""The input acts through a play of half width b."""

from islands.discrepancy.effects import stiction
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site
from islands.systems.hysteresis_operators import played


def _form(u: Signal, values: Signal, _scene: Scene) -> Signal:
    return played(u, values[0]) if values[0] > 0.0 else u


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("b", scene.input_unit, 0.0, 0.005 * scene.input_peak, 0.0, 0.3 * scene.input_peak),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple((part * scene.input_peak,) for part in (0.005, 0.0175, 0.05, 0.125))


EFFECT = Effect(
    name="backlash",
    family="memory",
    site=Site.INPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Tao and Kokotovic, Adaptive Control of Systems with Actuator and Sensor Nonlinearities",
    alike=(stiction.EFFECT, 2.0),
)
