"""An even part of the characteristic: + k x^2."""

from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.parameter import Parameter


def _form(x: Signal, _rate: Signal, values: Signal, _scene: Scene) -> Signal:
    return values[0] * x * x


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "k",
            f"{scene.output_unit}/{scene.input_unit}^2",
            0.0,
            0.01 * scene.output_peak / scene.input_peak**2,
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.02 * scene.output_peak / scene.input_peak**2,),)


EFFECT = Effect(
    name="even-nonlinearity",
    family="shape",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Worden and Tomlinson, Nonlinearity in Structural Dynamics, section 2",
)
