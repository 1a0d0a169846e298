"""Offspring: the evaluated individuals of a generation as rows of arrays."""

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from islands.evolution.gene_index import GeneIndex
from islands.evolution.individual import Individual
from islands.evolution.structure_table import StructureTable
from islands.kernels.breeding import Individuals, empty_individuals
from islands.kernels.population import ABANDONED, OK
from islands.simulation.outcome import EvaluationOutcome


class Parents(NamedTuple):
    """Individuals that may become parents.

    Attributes
    ----------
    genes : Individuals
        Numbers of the genes.
    places : ndarray of int64, shape (individuals,)
        Numbers of the structures.
    fitness : ndarray of float64, shape (individuals,)
    abandoned : ndarray of bool, shape (individuals,)
        Whether the evaluation was abandoned.
    """

    genes: Individuals
    places: NDArray[np.int64]
    fitness: NDArray[np.float64]
    abandoned: NDArray[np.bool_]


def join(one: Parents, other: Parents) -> Parents:
    """Return the individuals of two groups."""
    most = max(one.genes.genes.shape[1], other.genes.genes.shape[1])
    count = len(one.places)
    genes = empty_individuals(count + len(other.places), most)
    genes.genes[:count, : one.genes.genes.shape[1]] = one.genes.genes
    genes.genes[count:, : other.genes.genes.shape[1]] = other.genes.genes
    lengths = np.concatenate([one.genes.lengths, other.genes.lengths])
    others = (np.concatenate(pair) for pair in zip(one[1:], other[1:], strict=True))
    return Parents(Individuals(genes.genes, lengths), *others)


class Offspring(Sequence[Individual]):
    """Evaluated individuals, each of which is made when it is first read.

    A generation reads few of its individuals: those that may enter the elite or the hall of fame. Offspring
    compare, print and pickle as a tuple of individuals.

    Parameters
    ----------
    index : GeneIndex
    structures : StructureTable
    outcomes : mapping
        Outcome by status code.
    genes : Individuals
        Genes that remain, as numbers of the index.
    places : ndarray of int64, shape (individuals,)
        Number of the structure of each individual.
    abandoned : ndarray of bool, shape (individuals,)
        Whether the error of an individual exceeds its threshold.
    """

    def __init__(
        self,
        index: GeneIndex,
        structures: StructureTable,
        outcomes: Mapping[int, EvaluationOutcome],
        genes: Individuals,
        places: NDArray[np.int64],
        abandoned: NDArray[np.bool_],
    ) -> None:
        self._index, self.structures, self._outcomes = index, structures, outcomes
        self.genes, self.places = genes, places
        self.status = np.where(abandoned, ABANDONED, structures.status[places])
        self.fitness = np.where(abandoned, inf, structures.fitness[places])
        self._made: dict[int, Individual] = {}

    @property
    def parents(self) -> Parents:
        """Individuals as arrays."""
        return Parents(self.genes, self.places, self.fitness, self.status == ABANDONED)

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Number of terms of each individual."""
        return self.structures.lengths[self.places]

    @property
    def outcomes(self) -> list[EvaluationOutcome]:
        """Outcome of each individual."""
        return [self._outcomes[code] for code in self.status.tolist()]

    def take(self, rows: NDArray[np.int64]) -> list[Individual]:
        """Return some individuals."""
        return [self[row] for row in rows.tolist()]

    def __len__(self) -> int:
        return len(self.places)

    @overload
    def __getitem__(self, row: int) -> Individual: ...

    @overload
    def __getitem__(self, row: slice) -> tuple[Individual, ...]: ...

    def __getitem__(self, row: int | slice) -> Individual | tuple[Individual, ...]:
        if isinstance(row, slice):
            return tuple(self)[row]
        row = range(len(self))[row]
        individual = self._made.get(row)
        if individual is None:
            individual = self._made[row] = self._make(row)
        return individual

    def _make(self, row: int) -> Individual:
        place, status = int(self.places[row]), int(self.status[row])
        length = int(self.structures.lengths[place])
        genes, most = self.genes.genes[row], int(self.genes.lengths[row])
        return Individual(
            tuple([self._index.genes[gene] for gene in genes[:most].tolist()]),
            self._index.regressors(self.structures.terms[place, :length].tolist()),
            tuple(self.structures.theta[place, :length].tolist()) if status == OK else (),
            float(self.fitness[row]),
            self._outcomes[status],
        )

    def __eq__(self, other: object) -> bool:
        if isinstance(other, (tuple, Offspring)):
            return tuple(self) == tuple(other)
        return NotImplemented

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return repr(tuple(self))

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        return tuple, (list(self),)


def read_fitness(individuals: Sequence[Individual]) -> NDArray[np.float64]:
    """Return the fitness of individuals."""
    if isinstance(individuals, Offspring):
        return individuals.fitness
    return np.array([each.fitness for each in individuals], np.float64)
