"""The clocks of input and output run apart: u(t (1 + e))."""

import numpy as np

from islands.discrepancy.effects.shifts import at_samples
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(u: Signal, values: Signal, _scene: Scene) -> Signal:
    return at_samples(u, np.arange(u.size) * (1.0 + values[0]))


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("e", "", 0.0, 0.01 * scene.dt / scene.fitted, -0.02, 0.02),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.5 * scene.dt / scene.fitted,), (-0.5 * scene.dt / scene.fitted,))


EFFECT = Effect(
    name="clock-skew",
    family="timing",
    site=Site.INPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Schoukens and Pintelon, System Identification: A Frequency Domain Approach, section 2",
)
