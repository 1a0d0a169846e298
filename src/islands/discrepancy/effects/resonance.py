"""A second-order mode follows the output: y'' + 2 zeta w y' + w^2 y = w^2 v."""

import numpy as np
import scipy

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site

#: Radians of a sample: a faster mode is not there for this record.
FASTEST = 2.6


def _form(y: Signal, values: Signal, scene: Scene) -> Signal:
    period, zeta = values
    w = 2 * np.pi / period if period > 0.0 else np.inf
    if w * scene.dt > FASTEST:
        return y
    # Bilinear, with the resonance itself kept where it is. In finer steps, the output interpolated between
    # its samples, it takes the place of a delay where these are sparse (the gas furnace, the hair dryer).
    k = w / np.tan(w * scene.dt / 2)
    scale = k * k + 2 * zeta * w * k + w * w
    b = w * w / scale
    a1, a2 = 2 * (w * w - k * k) / scale, (k * k - 2 * zeta * w * k + w * w) / scale
    followed, _ = scipy.signal.lfilter([b, 2 * b, b], [1.0, a1, a2], y - y[0], zi=[0.0, 0.0])
    out: Signal = followed + y[0]
    return out


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter("period", "s", 0.0, scene.dt, 0.0, scene.fitted / 8),
        Parameter("zeta", "", 0.1, 0.05, 0.003, 2.0),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple(
        (period * scene.dt, zeta) for period in (2.9, 5.0, 9.0, 16.0, 30.0) for zeta in (0.03, 0.1, 0.3)
    )


EFFECT = Effect(
    name="resonance",
    family="timing",
    site=Site.OUTPUT,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Ljung, System Identification, 2nd ed., section 4",
)
