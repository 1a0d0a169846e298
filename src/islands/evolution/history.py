"""History of a search: the least fitness by generation."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class HistoryPoint:
    """One point of a search's course.

    Attributes
    ----------
    generation : int
    evaluations : int
        Until then.
    best : mapping
        The least fitness (mean squared shooting error) of every size.
    islands : tuple of float
        The least fitness of every island; infinite where it has no model yet.
    """

    generation: int
    evaluations: int
    best: Mapping[int, float]
    islands: tuple[float, ...]
