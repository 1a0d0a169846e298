"""The outflow has a linear part beside that of Bernoulli's law: + l x in the flow out of one state."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site

#: What the names of these effects begin with; the state's own stands behind it.
NAME = "outflow-law"


def outflow_law(state: str) -> Effect:
    """Return the effect on one state, in 1/s."""
    label = f"{NAME}:{state}"

    def parameters(scene: Scene) -> tuple[Parameter, ...]:
        return (Parameter(label, "1/s", 0.0, 1.0 / scene.fitted),)

    def grid(scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
        return tuple((times / scene.fitted,) for times in (1.0, 5.0, 25.0))

    return Effect(
        name=label,
        family="shape",
        site=Site.CORE,
        parameters=parameters,
        grid=grid,
        form=None,
        source="Schoukens and Noel, Three benchmarks addressing open challenges, 2017",
    )
