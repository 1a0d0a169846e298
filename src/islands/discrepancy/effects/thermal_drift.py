"""The output follows a temperature: y + k (T - T(0)), T a given channel."""

from islands.discrepancy.effects.channels import channel, channel_unit, spread, there
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    return y + values[0] * channel(scene, True)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "k",
            f"{scene.output_unit}/{channel_unit(scene, True)}",
            0.0,
            0.01 * scene.output_peak / spread(scene, True),
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.output_peak / spread(scene, True),),)


EFFECT = Effect(
    name="thermal-drift",
    family="baseline",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Doebelin, Measurement Systems, section 2",
    applies=lambda scene: there(scene, True),
)
