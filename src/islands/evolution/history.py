"""History of a search: the best fitness by generation."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class HistoryPoint:
    """Best fitness at one generation.

    Attributes
    ----------
    generation : int
    evaluations : int
        Individuals evaluated up to this generation.
    best : mapping
        Best fitness (mean squared shooting error) of every model size.
    islands : tuple of float
        Best fitness of every island; infinite if the island has no model yet.
    """

    generation: int
    evaluations: int
    best: Mapping[int, float]
    islands: tuple[float, ...]
