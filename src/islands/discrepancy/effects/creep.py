"""The output creeps: y + kappa times y behind a low-pass of time constant tau."""

import numpy as np

from islands.discrepancy.effects.filters import low_pass
from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    return y + values[0] * (low_pass(y, float(np.exp(values[1])), scene.dt) - y[0])


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter("kappa", "", 0.0, 0.02, -0.5, 1.0),
        Parameter("log_tau", "ln s", 0.0, 0.3, np.log(5 * scene.dt), np.log(1.5 * scene.fitted)),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    taus = (max(part * scene.fitted, 6 * scene.dt) for part in (0.003, 0.01, 0.03, 0.1, 0.3))
    return tuple((0.03, float(np.log(tau))) for tau in taus)


EFFECT = Effect(
    name="exponential-creep",
    family="memory",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Kuhnen and Janocha, Inverse feedforward controller for complex hysteretic nonlinearities, 1999",
)
