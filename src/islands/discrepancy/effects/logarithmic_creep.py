"""The output creeps with the logarithm of time: y + kappa times a sum of low-passes, two to a decade."""

from islands.discrepancy.effects.filters import low_pass
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site

#: Time constants in seconds.
TAUS = (0.3, 1.0, 3.0, 10.0, 30.0)


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    return y + values[0] * sum(low_pass(y, tau, scene.dt) - y[0] for tau in TAUS)


def _parameters(_scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("kappa", "", 0.0, 0.005, -0.3, 0.3),)


def _grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.01,),)


EFFECT = Effect(
    name="logarithmic-creep",
    family="memory",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Jung and Gweon, Creep characteristics of piezoelectric actuators, 2000",
)
