"""Something flows in, or pushes, beside the input: + c in the balance of one state."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site

#: What the names of these effects begin with; the state's own stands behind it.
NAME = "input-offset"


def input_offset(state: str) -> Effect:
    """Return the effect on one state, in the unit of the input."""
    label = f"{NAME}:{state}"

    def parameters(scene: Scene) -> tuple[Parameter, ...]:
        return (Parameter(label, scene.input_unit, 0.0, 0.01 * scene.input_peak),)

    def grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
        return ((0.02 * scene.input_peak,),)

    return Effect(
        name=label,
        family="baseline",
        site=Site.CORE,
        parameters=parameters,
        grid=grid,
        form=None,
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
    )
