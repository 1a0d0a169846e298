"""A parameter of a simulation or of an effect: a physical quantity with bounds."""

from dataclasses import dataclass
from math import inf


@dataclass(frozen=True, slots=True)
class Parameter:
    """A physical quantity.

    Attributes
    ----------
    name : str
    unit : str
        "" where it has none.
    nominal : float
        A simulation's: where nothing else is known. An effect's: at which it does nothing.
    scale : float
        A change that matters: steps of derivatives are a hundredth of it.
    lower, upper : float
        Bounds.
    initial : bool
        It is a state at the first sample, and belongs to the record more than to the simulation.
    """

    name: str
    unit: str
    nominal: float
    scale: float
    lower: float = -inf
    upper: float = inf
    initial: bool = False
