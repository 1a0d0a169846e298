"""Swap search: forward steps and exchanges of single genes by the shooting error.

Forward selection ranks candidates by the one-step-ahead error and never revises a choice. The swap search
adds the gene that reduces the shooting error most, exchanges single genes as long as the error falls, and
continues with the next size. Its structures seed the evolution, which is not bound to the pool.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from math import inf

import numpy as np
from numpy.typing import NDArray

from islands.evolution.evaluation import Evaluator
from islands.evolution.individual import Individual, Population
from islands.evolution.offspring import Offspring
from islands.evolution.variation import Genes, with_required_genes
from islands.expressions.tree import Expression
from islands.kernels.breeding import Individuals
from islands.progress import Steps

#: Smallest relative reduction of the squared error for which an exchange continues.
_MIN_GAIN = 1e-3

#: Squared error relative to the mean square of the output below which it is a rounding error.
_ROUNDING = 1e-26

#: A structure whose squared error exceeds that of the current one by this factor is abandoned.
_ABANDON_FACTOR = 4.0

#: Maximum number of evaluations; the search then ends with the structures found so far.
MAX_EVALUATIONS = 60_000


def swap_search(
    evaluator: Evaluator,
    pool: Sequence[Expression],
    starts: Iterable[Genes] = (),
    depth: int = 40,
    steps: Steps | None = None,
) -> tuple[Population, ...]:
    """Search structures over a pool of genes.

    Parameters
    ----------
    evaluator : Evaluator
        Evaluates structures; its settings limit their number of genes.
    pool : sequence of Expression
        Genes to choose from.
    starts : iterable of genes
        Further structures; the exchanges start from one of them if it is better than the forward step.
    depth : int
        Number of structures that are returned for every size.
    steps : Steps, optional
        The search is an optional step, which ends with the structures so far before a size or an exchange.

    Returns
    -------
    tuple of populations
        Evaluated individuals of every size found, smallest size first and best first.
    """
    search = _SwapSearch(evaluator, pool)
    search.evaluate(starts)
    best = with_required_genes((), evaluator.settings)
    exact = _ROUNDING * float(np.mean(evaluator.record.y**2))
    first = search.evaluate([best]) if best else None
    error = inf if first is None else first.fitness
    steps = steps or Steps()
    skip = partial(steps.skip, f"swap search among {len(pool)} candidates")
    while error > exact > 0.0 and len(best) < evaluator.settings.max_terms and not search.is_exhausted:
        if skip():
            break
        steps.report(f"swap search among {len(pool)} candidates: {len(best) + 1} terms", None)
        extended = search.extend(best)
        known = search.best(len(best) + 1)
        start = min((structure for structure in (extended, known) if structure), key=_order, default=None)
        if start is None or start.size <= len(best):
            break
        exchanged = search.exchange(start, skip)
        best, error = exchanged.genes, exchanged.fitness
    return search.ranked(depth)


class _SwapSearch:
    """Structures that were evaluated, by size.

    Most of them are compared by their errors alone, so that their individuals are not made.
    """

    def __init__(self, evaluator: Evaluator, pool: Sequence[Expression]) -> None:
        # The numbers of genes are valid for the whole search: its evaluations fit into the caches.
        evaluator.prepare()
        self._evaluator, self._index = evaluator, evaluator.gene_index
        self._pool = self._number(pool)
        self._required = self._number(with_required_genes((), evaluator.settings))
        self._found: dict[int, list[tuple[Offspring, NDArray[np.int64]]]] = defaultdict(list)
        self._places: NDArray[np.int64] = np.empty(0, np.int64)
        self._evaluations = 0

    @property
    def is_exhausted(self) -> bool:
        """Whether the budget of evaluations is used up."""
        return self._evaluations >= MAX_EVALUATIONS

    def evaluate(self, structures: Iterable[Genes]) -> Individual | None:
        """Evaluate structures and return the best one; None if all fail."""
        return self._evaluate(self._index.number_genes(list(structures)), inf)

    def extend(self, genes: Genes) -> Individual | None:
        """Evaluate a structure with each other gene of the pool in addition; return the best one."""
        known = self._number(genes)
        others = self._pool[~np.isin(self._pool, known)]
        extended = np.column_stack([np.tile(known, (len(others), 1)), others])
        return self._evaluate(Individuals(extended, np.full(len(others), len(known) + 1)), inf)

    def exchange(self, start: Individual, skip: Callable[[], bool]) -> Individual:
        """Exchange single genes, each time the best exchange of all, as long as the error falls."""
        best = start
        while not (self.is_exhausted or skip()):
            genes = self._number(best.genes)
            free = np.flatnonzero(~np.isin(genes, self._required))
            others = self._pool[~np.isin(self._pool, genes)]
            exchanges = np.tile(genes, (len(free) * len(others), 1))
            exchanges[np.arange(len(exchanges)), np.repeat(free, len(others))] = np.tile(others, len(free))
            exchanged = self._evaluate(
                Individuals(exchanges, np.full(len(exchanges), len(genes))), _ABANDON_FACTOR * best.fitness
            )
            if exchanged is None or not exchanged.fitness < (1.0 - _MIN_GAIN) * best.fitness:
                break
            best = exchanged
        return best

    def _number(self, genes: Iterable[Expression]) -> NDArray[np.int64]:
        return np.array([self._index.number_gene(gene) for gene in genes], np.int64)

    def _evaluate(self, structures: Individuals, threshold: float) -> Individual | None:
        """Evaluate structures and return the best one; None if all fail or exceed the threshold."""
        count = len(structures.lengths)
        thresholds = [threshold] * (self._evaluator.settings.max_terms + 1)
        evaluated, _ = self._evaluator.evaluate_genes(structures, np.zeros(count, np.bool_), thresholds)
        self._evaluations += count
        rows = np.flatnonzero(np.isfinite(evaluated.fitness))
        self._keep(evaluated, rows)
        return _find_best(evaluated, rows[evaluated.sizes[rows] == evaluated.sizes[rows].max(initial=0)])

    def _keep(self, evaluated: Offspring, rows: NDArray[np.int64]) -> None:
        """Keep the first individual of each structure."""
        places, first = np.unique(evaluated.places[rows], return_index=True)
        new = ~np.isin(places, self._places)
        self._places = np.concatenate([self._places, places[new]])
        rows = rows[first[new]]
        sizes = evaluated.sizes[rows]
        for size in np.unique(sizes).tolist():
            self._found[size].append((evaluated, rows[sizes == size]))

    def best(self, size: int) -> Individual | None:
        """Return the best structure of a size."""
        candidates = (_find_best(*candidate) for candidate in self._found.get(size, ()))
        return min((candidate for candidate in candidates if candidate), key=_order, default=None)

    def ranked(self, depth: int) -> tuple[Population, ...]:
        """Return the best structures of every size."""
        return tuple(_rank(found, depth) for _, found in sorted(self._found.items()))


def _find_best(evaluated: Offspring, rows: NDArray[np.int64]) -> Individual | None:
    """Return the first of some individuals of one size; their texts decide between equal errors."""
    errors = evaluated.fitness[rows]
    return min(evaluated.take(rows[errors == errors.min(initial=inf)]), key=_order, default=None)


def _rank(found: Sequence[tuple[Offspring, NDArray[np.int64]]], depth: int) -> Population:
    """Return the first individuals of one size."""
    errors = np.sort(np.concatenate([evaluated.fitness[rows] for evaluated, rows in found]))
    limit = errors[min(depth, errors.size) - 1]
    first = [
        each for evaluated, rows in found for each in evaluated.take(rows[evaluated.fitness[rows] <= limit])
    ]
    return tuple(sorted(first, key=_order)[:depth])


def _order(individual: Individual) -> tuple[int, float, tuple[str, ...]]:
    return -individual.size, individual.fitness, individual.key
