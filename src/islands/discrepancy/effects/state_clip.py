"""A state stops at a level, as a tank's at its rim: what is above it is lost, or spills on in part."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site

#: What the names of these effects begin with; the state's own stands behind it.
NAME = "state-clip"

#: Starting points: the level in parts of the output's peak, and the part that spills on.
_LEVELS, _CAUGHT = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.2, 1.5), (0.0, 0.5)

#: Further than this, in the output's peak, no state goes.
_FAR = 4.0


def state_clip(state: str) -> Effect:
    """Return the effect on one state; the last one of a chain spills nowhere."""
    label = f"{NAME}:{state}"

    def parameters(scene: Scene) -> tuple[Parameter, ...]:
        peak = scene.output_peak
        level = Parameter(label, scene.output_unit, _FAR * peak, 0.01 * peak, 0.1 * peak, _FAR * peak)
        return (level, Parameter(f"{label} caught", "", 0.0, 0.05, 0.0, 1.0))

    def grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
        return tuple((level * scene.output_peak, caught) for level in _LEVELS for caught in _CAUGHT)

    return Effect(
        name=label,
        family="shape",
        site=Site.CORE,
        parameters=parameters,
        grid=grid,
        form=None,
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
        linear=0,
    )
