"""A hysteretic element, beside one that may be there: + k z, z' = x' - chi |x'| z - g x' |z|."""

from typing import Any

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Element, Scene, Signal, Site

#: Starting points: how quickly it turns, in one over the coordinate's peak, and g in parts of chi.
_QUICK, _BENT = (0.3, 1.0, 2.5, 8.0, 25.0), (0.0, 0.8, -1.2)


def _force(_x: float, _rate: float, z: float, numbers: Any) -> float:
    return numbers[0] * z


def _memory(_x: float, rate: float, z: float, numbers: Any) -> float:
    return rate - numbers[1] * abs(rate) * z - numbers[2] * rate * abs(z)


def _parameters(scene: Scene) -> tuple[Parameter, ...]:
    frame = scene.frame
    turn = 1.0 / frame.peak
    return (
        Parameter("k", f"{frame.force_unit}/{frame.unit}", 0.0, 0.01 * frame.force * turn, frame.least),
        Parameter("chi", f"1/{frame.unit}", turn, 0.3 * turn, 0.0, 100.0 * turn),
        Parameter("g", f"1/{frame.unit}", 0.0, 0.3 * turn, -50.0 * turn, 50.0 * turn),
        Parameter(
            "z0", frame.unit, 0.0, 0.05 * frame.peak, -3.0 * frame.peak, 3.0 * frame.peak, initial=True
        ),
    )


def _grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
    frame = scene.frame
    return tuple(
        (0.03 * frame.force / frame.peak, quick / frame.peak, bent * quick / frame.peak, 0.0)
        for quick in _QUICK
        for bent in _BENT
    )


EFFECT = Effect(
    name="second-hysteresis",
    family="memory",
    site=Site.FORCE,
    parameters=_parameters,
    grid=_grid,
    form=Element(_force, _memory, begins=3),
    source="Ikhouane and Rodellar, Systems with Hysteresis, section 2",
)
