"""A second hysteretic element acts beside the first: + k z, z' = x' - chi |x'| z - g x' |z|."""

import numpy as np

from islands.discrepancy.effect import Effect, Scene, Signal, Site
from islands.discrepancy.parameter import Parameter
from islands.kernels.hysteresis import bouc_wen


def _form(x: Signal, _rate: Signal, values: Signal, scene: Scene) -> Signal:
    z = np.empty_like(x)
    bouc_wen(x, scene.dt, 1.0, values[1], values[2], 0.0, 0.0, 0.0, 0.0, z)
    return values[0] * z


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "k", f"{scene.output_unit}/{scene.input_unit}", 0.0, 0.01 * scene.output_peak / scene.input_peak
        ),
        Parameter(
            "chi",
            f"1/{scene.input_unit}",
            1.0 / scene.input_peak,
            0.3 / scene.input_peak,
            0.0,
            100.0 / scene.input_peak,
        ),
        Parameter(
            "g",
            f"1/{scene.input_unit}",
            0.0,
            0.3 / scene.input_peak,
            -50.0 / scene.input_peak,
            50.0 / scene.input_peak,
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    return tuple(
        (0.03 * scene.output_peak / scene.input_peak, chi / scene.input_peak, 0.0) for chi in (2.5, 8.0, 25.0)
    )


EFFECT = Effect(
    name="second-hysteresis",
    family="memory",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=_form,
    source="Ikhouane and Rodellar, Systems with Hysteresis, section 2",
)
