"""Effects: physics that a simulation may lack, one file per family. Read `interface.effect` first."""

from islands.effects.interface.context import Parameter
from islands.effects.interface.effect import Effect, Site

__all__ = ["Effect", "Parameter", "Site"]
