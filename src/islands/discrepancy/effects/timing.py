"""The input acts later than it is recorded: u(t - tau)."""

import numpy as np

from islands.discrepancy.effects.shifts import at_samples
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(u: Signal, values: Signal, scene: Scene) -> Signal:
    return at_samples(u, np.arange(u.size) - values[0] / scene.dt)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (Parameter("tau", "s", 0.0, scene.dt, -0.2 * scene.dt, min(30 * scene.dt, scene.fitted / 4)),)


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return ((0.5 * scene.dt,), (2 * scene.dt,), (6 * scene.dt,))


EFFECT = Effect(
    name="delay",
    family="timing",
    site=Site.INPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Ljung, System Identification, 2nd ed., section 16",
)
