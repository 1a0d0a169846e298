"""A parameter of the simulation is off: it is another one than its tolerance allows."""

from islands.discrepancy.interfaces.context import Parameter
from islands.discrepancy.interfaces.effect import Effect, Scene, Signal, Site

#: What the names of these effects begin with; the parameter's own stands behind it.
NAME = "wrong-parameter"


def wrong_parameter(parameter: Parameter) -> Effect:
    """Return the effect of one parameter of a simulation: it is (1 + r) times what it is taken for."""
    label = f"{NAME}:{parameter.name}"

    def parameters(_scene: Scene) -> tuple[Parameter, ...]:
        return (Parameter(label, "", 0.0, 0.02, -0.8, 4.0),)

    def grid(_scene: Scene, _residual: Signal) -> tuple[tuple[float, ...], ...]:
        return ((0.05,), (-0.05,))

    return Effect(
        name=label,
        family="scale",
        site=Site.PARAMETER,
        parameters=parameters,
        grid=grid,
        form=None,
        source="Ljung, System Identification, 2nd ed., section 7",
    )
