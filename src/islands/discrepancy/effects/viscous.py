"""A force against the rate: - c x'."""

from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.effects.rates import rate_of
from islands.discrepancy.parameter import Parameter


def _form(_x: Signal, rate: Signal, values: Signal, _scene: Scene) -> Signal:
    return -values[0] * rate


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "c", f"{scene.output_unit} s/{scene.input_unit}", 0.0, 0.01 * scene.output_peak / rate_of(scene)
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.output_peak / rate_of(scene),),)


EFFECT = Effect(
    name="viscous",
    family="timing",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Armstrong-Helouvry, Dupont and Canudas de Wit, 1994",
)
