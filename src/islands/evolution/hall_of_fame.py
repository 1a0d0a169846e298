"""The hall of fame: the best models of every size that a search has seen.

Merging is associative, commutative and idempotent, so halls may be gathered from islands in any order.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import inf, isfinite

from islands.evolution.gp.individual import Individual

#: Models that are kept of every size: validation chooses among them.
DEPTH = 8


@dataclass(frozen=True, slots=True)
class HallOfFame:
    """Individuals, by size and within a size best first; each structure once."""

    entries: tuple[Individual, ...] = ()

    def places(self) -> Iterator[tuple[int, Individual]]:
        """Yield the individuals, each with its place among those of its size, from 1 on."""
        places: Counter[int] = Counter()
        for entry in self.entries:
            places[entry.size] += 1
            yield places[entry.size], entry

    def last(self) -> dict[int, float]:
        """Return, for every size that is full, the fitness of its last individual: nobody worse enters."""
        return {entry.size: entry.fitness for place, entry in self.places() if place == DEPTH}

    def best(self) -> dict[int, Individual]:
        """Return the best individual of every size."""
        found: dict[int, Individual] = {}
        for entry in self.entries:
            found.setdefault(entry.size, entry)
        return found


def with_entries(hall: HallOfFame, individuals: Iterable[Individual]) -> HallOfFame:
    """Return the hall with individuals added; a fitness that is not finite never enters."""
    last = hall.last()
    found: dict[tuple[str, ...], Individual] = {}
    for entry in (*hall.entries, *individuals):
        if not isfinite(entry.fitness) or entry.fitness > last.get(entry.size, inf):
            continue
        known = found.get(entry.key)
        if known is None or _order(entry) < _order(known):
            found[entry.key] = entry
    ordered = HallOfFame(tuple(sorted(found.values(), key=_order)))
    # Genes in canonical form: which of two ways to write a model came first must not matter.
    return HallOfFame(
        tuple(
            replace(entry, genes=tuple(item.expression for item in entry.regressors))
            for place, entry in ordered.places()
            if place <= DEPTH
        )
    )


def pareto_front(individuals: Iterable[Individual]) -> tuple[Individual, ...]:
    """Return the Pareto front of error and size: the best of every size that no smaller one beats."""
    found: list[Individual] = []
    for each in sorted(individuals, key=lambda each: (each.size, each.fitness)):
        if not found or each.fitness < found[-1].fitness:
            found.append(each)
    return tuple(found)


def merge(*halls: HallOfFame) -> HallOfFame:
    """Gather halls of fame."""
    return with_entries(HallOfFame(), (entry for hall in halls for entry in hall.entries))


def _order(entry: Individual) -> tuple[int, float, tuple[str, ...], tuple[float, ...]]:
    return entry.size, entry.fitness, entry.key, entry.theta
