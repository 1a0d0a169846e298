"""The hall of fame: the best models of every size that a search has seen.

Merging is associative, commutative and idempotent, so halls may be gathered from islands in any order.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import isfinite

from islands.evolution.individual import Individual

#: Models that are kept of every size: validation chooses among them.
DEPTH = 8


@dataclass(frozen=True, slots=True)
class HallOfFame:
    """Individuals, by size and within a size best first; each structure once."""

    entries: tuple[Individual, ...] = ()

    def best(self) -> dict[int, Individual]:
        """Return the best individual of every size."""
        found: dict[int, Individual] = {}
        for entry in self.entries:
            found.setdefault(entry.size, entry)
        return found

    def front(self) -> tuple[Individual, ...]:
        """Return the Pareto front: the best of every size that no smaller one beats."""
        front: list[Individual] = []
        for entry in self.best().values():
            if not front or entry.fitness < front[-1].fitness:
                front.append(entry)
        return tuple(front)


def with_entries(hall: HallOfFame, individuals: Iterable[Individual]) -> HallOfFame:
    """Return the hall with individuals added; a fitness that is not finite never enters."""
    found: dict[tuple[str, ...], Individual] = {}
    for entry in (*hall.entries, *individuals):
        known = found.get(entry.key)
        if isfinite(entry.fitness) and (known is None or _order(entry) < _order(known)):
            found[entry.key] = entry
    kept: list[Individual] = []
    places: dict[int, int] = {}
    for entry in sorted(found.values(), key=_order):
        places[entry.size] = places.get(entry.size, 0) + 1
        if places[entry.size] <= DEPTH:
            # Genes in canonical form: which of two ways to write a model came first must not matter.
            kept.append(replace(entry, genes=tuple(item.expression for item in entry.regressors)))
    return HallOfFame(tuple(kept))


def merge(*halls: HallOfFame) -> HallOfFame:
    """Gather halls of fame."""
    return with_entries(HallOfFame(), (entry for hall in halls for entry in hall.entries))


def _order(entry: Individual) -> tuple[int, float, tuple[str, ...], tuple[float, ...]]:
    return entry.size, entry.fitness, entry.key, entry.theta
