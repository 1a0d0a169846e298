"""Evaluation of individuals (the paper, section 5.2): prune, estimate under constraints, simulate.

An evaluator holds the record as the kernels want it, and caches. What it returns depends on the individuals
and the pruning decisions alone, never on what it has seen before.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from islands.data.dataset import Dataset
from islands.estimation.constrained import constrained_least_squares
from islands.estimation.constraints import CONSTRAINTS
from islands.estimation.froe import prune
from islands.estimation.normal_equations import from_gram
from islands.evolution.fitness import FITNESSES
from islands.evolution.individual import Individual, distinct_genes
from islands.evolution.settings import Settings
from islands.kernels.simulate import simulate
from islands.kernels.sums import total
from islands.model.expression import Expression, Lagged
from islands.model.regressor import Regressor
from islands.program.columns import regressor_matrix
from islands.program.inner_products import InnerProducts
from islands.program.linker import link
from islands.simulation.layout import layout
from islands.simulation.outcome import OK, Outcome, Verdict
from islands.simulation.predictors import bound_of

#: Evaluations that are remembered; a full table is emptied.
_REMEMBERED = 1 << 18

_NO_TERMS = Outcome(Verdict.INFEASIBLE, "no gene is left")


@dataclass(frozen=True, slots=True)
class Evaluation:
    """A structure's regressors after pruning and constraints, parameters, fitness and outcome."""

    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...]
    fitness: float
    outcome: Outcome


class Evaluator:
    """Evaluates individuals on one record.

    Parameters
    ----------
    record : Dataset
        Complete.
    settings : Settings
    """

    def __init__(self, record: Dataset, settings: Settings) -> None:
        self.record, self.settings = record, settings
        self.warm_up = settings.maximum_lag
        self._cut = layout(record, self.warm_up, FITNESSES[settings.fitness](settings.shooting))
        self._in_time = np.argsort(self._cut.start, kind="stable")
        self._bound = bound_of(record)
        self._constrain = CONSTRAINTS[settings.constraints].constrain
        self._products = InnerProducts(record, self.warm_up)
        self._seen: dict[tuple[tuple[str, ...], bool], Evaluation] = {}

    def evaluate(self, population: Sequence[tuple[Individual, bool]]) -> tuple[tuple[Individual, ...], int]:
        """Evaluate individuals, each with the decision whether it is pruned.

        Returns
        -------
        individuals : tuple of Individual
            In the same order; genes that did not survive are gone.
        duplicates : int
            How many have the structure of another one or of one seen before.
        """
        if len(self._seen) > _REMEMBERED:
            self._seen.clear()
        genes = [distinct_genes(individual.genes) for individual, _ in population]
        structures = [tuple(sorted(found, key=lambda item: item.content)) for found in genes]
        keys = [
            (tuple(item.text for item in structure), pruned)
            for structure, (_, pruned) in zip(structures, population, strict=True)
        ]
        fresh = {
            key: structure for key, structure in zip(keys, structures, strict=True) if key not in self._seen
        }
        self._products.prepare(fresh.values())
        for key, structure in fresh.items():
            self._seen[key] = self._evaluate(structure, key[1])
        evaluated = tuple(
            _with(individual, found, self._seen[key])
            for (individual, _), found, key in zip(population, genes, keys, strict=True)
        )
        return evaluated, len(keys) - len(fresh)

    def _evaluate(self, structure: tuple[Regressor, ...], pruned: bool) -> Evaluation:
        if not structure:
            return _failure((), _NO_TERMS)
        gram = self._products.gram(structure)
        if not np.isfinite(gram).all():
            return _failure(structure, Outcome(Verdict.DIVERGED, "a regressor overflows on the record"))
        if pruned:
            kept = prune(gram, self.settings.tolerance)
            if not kept:
                return _failure((), _NO_TERMS)
            structure = tuple(structure[position] for position in kept)
        constrained = self._constrain(structure)
        if isinstance(constrained, Outcome):
            return _failure(structure, constrained)
        structure = constrained.regressors
        gram = self._products.gram(structure)
        theta = from_gram(gram, constrained.S, constrained.c)
        if theta is None:
            *psi, y = regressor_matrix([*structure, Lagged(0, 0)], self.record, self.warm_up)
            estimate = constrained_least_squares(np.array(psi), y, constrained.S, constrained.c)
            theta = estimate.theta if estimate.outcome else estimate.outcome
        if isinstance(theta, Outcome):
            return _failure(structure, theta)
        return self.simulated(structure, tuple(theta.tolist()))

    def simulated(self, structure: tuple[Regressor, ...], theta: tuple[float, ...]) -> Evaluation:
        """Return the fitness of a model with given parameters."""
        squared = np.empty(len(self._cut.start))
        diverged = np.full(len(self._cut.start), -1, np.int64)
        simulate(
            link(structure), np.array(theta), self._cut, self._bound, False, squared, diverged, np.empty(0)
        )
        if (diverged >= 0).any():
            return _failure(structure, Outcome(Verdict.DIVERGED, "an interval left the bound"))
        fitness = total(squared[self._in_time]) / self._cut.length.sum()
        return Evaluation(structure, theta, float(fitness), OK)


def _failure(structure: tuple[Regressor, ...], outcome: Outcome) -> Evaluation:
    return Evaluation(structure, (), np.inf, outcome)


def _with(individual: Individual, genes: dict[Regressor, Expression], found: Evaluation) -> Individual:
    kept = set(found.regressors)
    left = tuple(gene for item, gene in genes.items() if item in kept)
    return replace(
        individual,
        genes=left or individual.genes,
        regressors=found.regressors,
        theta=found.theta,
        fitness=found.fitness,
        outcome=found.outcome,
    )
