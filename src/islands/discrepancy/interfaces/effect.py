"""An effect: something that a simulation may lack, with its form, its place and its strengths."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from islands.discrepancy.interfaces.context import Parameter, Signal, SimulationContext
from islands.discrepancy.interfaces.force import ForceLaw

__all__ = ["Effect", "EffectTemplate", "ForceLaw", "Signal", "SimulationContext", "Site"]


class Site(StrEnum):
    """Where an effect enters."""

    INPUT = "input map"
    FORCE = "coordinate and rate"
    CORE = "state equation"
    PARAMETER = "parameter"
    OUTPUT = "output map"


#: What a map does: ``(signal, values, scene) -> signal``.
Map = Callable[[Signal, Signal, SimulationContext], Signal]


@dataclass(frozen=True, slots=True)
class Effect:
    """An entry of the catalogue.

    Attributes
    ----------
    name : str
    summary : str
        What it is, in one sentence with its form.
    family : str
    site : Site
    parameters : callable
        ``scene -> tuple of Parameter``: strength first, then shape.
    grid : callable
        ``(scene, residual) -> points``: values that a search begins from; the residual is that of the
        simulation as it stands.
    form : callable, ForceLaw or None
        What it does: a map, or the element that it puts on the coordinate. None: the simulation's own
        equation has its parameters, by their names.
    source : str
        Where its form is described.
    applies : callable
        ``scene -> bool``: whether the record could show it at all.
    linear : int
        How many of its parameters, from the first on, its response is proportional to, as long as it is weak.
    gain : bool
        It is a gain: calibration takes it up, unless every parameter has a tolerance.
    searched : int
        What it costs beside its values, in values: an instant or a frequency is known to a sample, and was
        looked for among all of them.
    alike : tuple or None
        Another effect that does the same on the average, with so many times its values.
    """

    name: str
    summary: str
    family: str
    site: Site
    parameters: Callable[[SimulationContext], tuple[Parameter, ...]]
    grid: Callable[[SimulationContext, Signal], Sequence[tuple[float, ...]]]
    form: Map | ForceLaw | None
    source: str
    applies: Callable[[SimulationContext], bool] = lambda _: True
    linear: int = 1
    gain: bool = False
    searched: int = 0
    alike: "tuple[Effect, float] | None" = None

    @property
    def cause(self) -> str:
        """Its name in the catalogue: without the state or the parameter that it is about."""
        return self.name.partition(":")[0]


@dataclass(frozen=True, slots=True)
class EffectTemplate:
    """An entry of the catalogue that exists once for each state, parameter or model of a simulation.

    Attributes
    ----------
    name, summary : str
        As in `Effect`; the name of an effect is followed by a colon and the name of its state or parameter.
    make : callable
        Makes the effect.
    """

    name: str
    summary: str
    make: Callable[..., Effect]
