"""Hall of fame: the best models of every size found by a search.

Merging is associative, commutative and idempotent, so halls of islands can be merged in any order.
"""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain
from math import inf, isfinite
from typing import TypeVar

from islands.evolution.individual import AnyIndividual, AnyPopulation, Individual

_Kind = TypeVar("_Kind", bound=AnyIndividual)


@dataclass(frozen=True, slots=True)
class HallOfFame:
    """Individuals ordered by size, then by fitness; each structure occurs once."""

    entries: AnyPopulation = ()

    def ranked(self) -> Iterator[tuple[int, AnyIndividual]]:
        """Yield each individual with its rank among those of its size, starting at 1."""
        ranks: Counter[int] = Counter()
        for entry in self.entries:
            ranks[entry.size] += 1
            yield ranks[entry.size], entry

    def entry_thresholds(self) -> dict[int, float]:
        """Return the fitness of the last individual of every full size.

        Individuals with a higher fitness of that size cannot enter.
        """
        return {entry.size: entry.fitness for rank, entry in self.ranked() if rank == entry.kept}

    def best(self) -> dict[int, AnyIndividual]:
        """Return the best individual of every size."""
        best: dict[int, AnyIndividual] = {}
        for entry in self.entries:
            best.setdefault(entry.size, entry)
        return best


def with_entries(hall: HallOfFame, individuals: Iterable[AnyIndividual]) -> HallOfFame:
    """Return the hall with individuals added; individuals without a finite fitness are ignored."""
    thresholds = hall.entry_thresholds()
    found: dict[tuple[str, ...], AnyIndividual] = {}
    for entry in chain(hall.entries, individuals):
        if not isfinite(entry.fitness) or entry.fitness > thresholds.get(entry.size, inf):
            continue
        known = found.get(entry.key)
        if known is None or _order(entry) < _order(known):
            found[entry.key] = entry
    ordered = HallOfFame(tuple(sorted(found.values(), key=_order)))
    # Store genes in canonical form, so that the result does not depend on which notation came first.
    return HallOfFame(
        tuple(_with_canonical_genes(entry) for rank, entry in ordered.ranked() if rank <= entry.kept)
    )


def _with_canonical_genes(entry: AnyIndividual) -> AnyIndividual:
    if not isinstance(entry, Individual):
        return entry
    genes = tuple([item.expression for item in entry.regressors])
    return entry if entry.genes == genes else replace(entry, genes=genes)


def pareto_front(individuals: Iterable[_Kind]) -> tuple[_Kind, ...]:
    """Return the Pareto front of error and size, smallest first."""
    front: list[_Kind] = []
    for individual in sorted(individuals, key=lambda individual: (individual.size, individual.fitness)):
        if not front or individual.fitness < front[-1].fitness:
            front.append(individual)
    return tuple(front)


def merge(halls: Iterable[HallOfFame]) -> HallOfFame:
    """Merge halls of fame. Thousands of them do not have to be in memory at the same time."""
    return with_entries(HallOfFame(), (entry for hall in halls for entry in hall.entries))


def _order(entry: AnyIndividual) -> tuple[int, float, tuple[str, ...], tuple[float, ...]]:
    return entry.size, entry.fitness, entry.key, entry.theta
