"""The archipelago: all islands at one epoch. A checkpoint is this value, and nothing else."""

from dataclasses import dataclass

from islands.evolution.hall_of_fame import HallOfFame, merge
from islands.evolution.island import Island


@dataclass(frozen=True, slots=True)
class Archipelago:
    """Islands at the same epoch.

    Attributes
    ----------
    islands : tuple of Island
        In the order of their index.
    epoch : int
        Generations that every island has taken; -1 before the first population.
    """

    islands: tuple[Island, ...] = ()
    epoch: int = -1

    @property
    def hall(self) -> HallOfFame:
        """The halls of fame of all islands, gathered."""
        return merge(*(island.hall for island in self.islands))
