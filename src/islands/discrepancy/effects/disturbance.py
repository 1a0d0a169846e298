"""A neighbour couples in: y + k w, w a given channel."""

from islands.discrepancy.effects.channels import channel, channel_unit, spread, there
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    return y + values[0] * channel(scene, False)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "k",
            f"{scene.output_unit}/{channel_unit(scene, False)}",
            0.0,
            0.01 * scene.output_peak / spread(scene, False),
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.output_peak / spread(scene, False),),)


EFFECT = Effect(
    name="cross-coupling",
    family="disturbance",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Ljung, System Identification, 2nd ed., section 13",
    applies=lambda scene: there(scene, False),
)
