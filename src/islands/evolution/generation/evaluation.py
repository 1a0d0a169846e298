"""Evaluation of individuals (the paper, section 5.2): prune, estimate under constraints, simulate.

An evaluator holds the record in the layout of the kernels, and caches. Its results depend only on the
individuals, the pruning decisions and the abandon thresholds, never on earlier calls.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.evolution.gp.err_targets import ERR_TARGETS
from islands.evolution.gp.fitness import FITNESSES
from islands.evolution.gp.gene_index import ZERO, GeneIndex
from islands.evolution.gp.individual import Individual
from islands.evolution.settings import Settings
from islands.kernels import population as kernel
from islands.kernels.pair_table import PLACE_BYTES, clear, pair_table
from islands.model.expression import Expression, Lagged
from islands.model.regressor import Regressor
from islands.program.regressor_matrix import select_rows
from islands.simulation.layout import layout
from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.simulation.predictors import divergence_bound

#: Indices of y(k) and y(k-1), the first terms of every gene index.
_TARGET = 0
_PREVIOUS = 1

_ABANDONED = EvaluationOutcome(Status.ABANDONED, "the error exceeds the abandon threshold of the island")
_DIVERGED = EvaluationOutcome(Status.DIVERGED, "the simulation left the divergence bound in an interval")

_OUTCOMES = {
    kernel.OK: OK,
    kernel.DIVERGED: _DIVERGED,
    kernel.ABANDONED: _ABANDONED,
    kernel.DEPENDENT: EvaluationOutcome(
        Status.SINGULAR, "the regressors are linearly dependent in the null space of the constraints"
    ),
    kernel.NO_TERMS: EvaluationOutcome(Status.INFEASIBLE, "no gene is left"),
    kernel.OVERFLOW: EvaluationOutcome(Status.DIVERGED, "a regressor overflows on the record"),
    kernel.WRONG_SIGN: EvaluationOutcome(Status.INFEASIBLE, "a parameter has the wrong sign"),
    kernel.NOT_CONVERGENT: EvaluationOutcome(
        Status.INFEASIBLE, "at constant input the linear output terms do not converge (Property 1)"
    ),
    kernel.TOO_FEW_ROWS: EvaluationOutcome(Status.TOO_FEW_ROWS, "there are not more rows than parameters"),
}


@dataclass(frozen=True, slots=True)
class Limits:
    """Byte limits of the caches of an evaluator. A cache is emptied when it exceeds its limit.

    Attributes
    ----------
    pairs : int
        Inner products of pairs of regressors. The table always has room for those of one individual.
    genes, structures : int
        Genes with their regressors, and cached evaluations; their size is estimated.
    """

    pairs: int = 1 << 25
    genes: int = 1 << 27
    structures: int = 1 << 27


#: Approximate size of a cached evaluation, in bytes.
_STRUCTURE_BYTES = 1_500

_Key = tuple[frozenset[int], bool]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Cached evaluation of a structure.

    Attributes
    ----------
    numbers, regressors : tuple
        Terms that remain after pruning and constraints, ordered by content.
    theta : tuple of float
        Parameters of the terms; empty after a failure.
    fitness : float
        Mean squared error; a lower bound if the evaluation was abandoned.
    outcome : EvaluationOutcome
    """

    numbers: tuple[int, ...]
    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...]
    fitness: float
    outcome: EvaluationOutcome

    def is_sufficient(self, allowed: NDArray[np.float64]) -> bool:
        """Return whether this evaluation answers a request with these thresholds by size."""
        return self.outcome is not _ABANDONED or self.fitness >= allowed[len(self.numbers)]

    def exceeds(self, allowed: NDArray[np.float64]) -> bool:
        """Return whether the error exceeds its threshold; after divergence, whether that is finite."""
        if self.outcome is _ABANDONED:
            return True
        simulated = self.outcome is OK or self.outcome is _DIVERGED
        return simulated and self.fitness > allowed[len(self.numbers)]


class Evaluator:
    """Evaluator of individuals on one record.

    Parameters
    ----------
    record : Dataset
        Complete.
    settings : Settings
    limits : Limits, optional
    abandon : bool
        Whether evaluations stop at their threshold. Affects the speed of a search, never its result.
    root_rule : bool
        Whether structures are infeasible whose linear output terms do not converge at constant input. False
        only to measure the effect of this rule: such structures are rejected after a search in any case.
    """

    def __init__(
        self,
        record: Dataset,
        settings: Settings,
        limits: Limits | None = None,
        abandon: bool = True,
        root_rule: bool = True,
    ) -> None:
        self.record, self.settings, self.limits, self.abandon = record, settings, limits or Limits(), abandon
        self.warm_up = settings.maximum_lag
        self._layout = layout(record, self.warm_up, FITNESSES[settings.fitness](settings.shooting))
        self._predicted = int(self._layout.length.sum())
        self._bound = divergence_bound(record)
        self._rows = select_rows(record, self.warm_up)
        self._constraint = constraint(settings.constraints)
        self._outcomes = _OUTCOMES | {
            kernel.INFEASIBLE: EvaluationOutcome(Status.INFEASIBLE, self._constraint.lacking),
        }
        self._pairs = pair_table(self.limits.pairs)
        self._evaluations: dict[_Key, Evaluation] = {}
        self._root_rule = root_rule
        self._gene_index = self._empty_index()

    def _empty_index(self) -> GeneIndex:
        return GeneIndex(self._constraint, (Lagged(0, 0), Lagged(0, 1)), self._root_rule)

    @property
    def context(self) -> kernel.PopulationContext:
        """Arguments of the kernel that all individuals share; valid until the next evaluation."""
        return kernel.PopulationContext(
            _TARGET,
            _PREVIOUS,
            ERR_TARGETS[self.settings.err_target],
            self.settings.tolerance,
            self._gene_index.nodes,
            self._gene_index.groups,
            self._pairs,
            self._rows,
            self._layout,
            self._bound,
        )

    @property
    def memory(self) -> dict[str, tuple[int, int]]:
        """Bytes in use and byte limit of each cache, by name."""
        return {
            "pairs": (PLACE_BYTES * int(self._pairs.taken[0]), self.limits.pairs),
            "genes": (self._gene_index.bytes, self.limits.genes),
            "structures": (_STRUCTURE_BYTES * len(self._evaluations), self.limits.structures),
        }

    def gene_indices(self, individual: Individual) -> frozenset[int]:
        """Return the indices of an individual's genes: equal sets mean equal structures.

        The indices are valid until the caches are cleared.
        """
        return frozenset(map(self._gene_index.index_of, individual.genes))

    def clear_caches(self) -> None:
        """Empty all caches."""
        clear(self._pairs)
        self._evaluations.clear()
        self._gene_index = self._empty_index()

    def evaluate(
        self, population: Sequence[tuple[Individual, bool]], thresholds: Sequence[float] | None = None
    ) -> tuple[tuple[Individual, ...], int]:
        """Evaluate individuals, each with the decision whether to prune it.

        Parameters
        ----------
        population : sequence of (Individual, bool)
            Individuals, and whether to prune each.
        thresholds : sequence of float, optional
            Abandon threshold of every model size, from 0. A simulation stops as soon as it diverges or its
            error exceeds the threshold; the outcome is `Status.ABANDONED`. Larger models are not abandoned.

        Returns
        -------
        individuals : tuple of Individual
            The evaluated individuals in the same order, without the genes that were removed.
        duplicates : int
            Number of individuals whose structure occurs earlier in the population or in the cache.
        """
        self._enforce_limits()
        index_of = self._gene_index.index_of
        genes: list[dict[int, Expression]] = []
        keys: list[_Key] = []
        for individual, pruned in population:
            by_number: dict[int, Expression] = {}
            for gene in individual.genes:
                by_number.setdefault(index_of(gene), gene)
            by_number.pop(ZERO, None)
            genes.append(by_number)
            keys.append((frozenset(by_number), pruned))
        self._check_lags()
        largest = max(map(len, genes), default=0)
        allowed = np.full(max(largest + 1, len(thresholds or ())), inf)
        if thresholds is not None and self.abandon:
            allowed[: len(thresholds)] = thresholds
        cache = self._evaluations
        missing = dict.fromkeys(
            key for key in keys if key not in cache or not cache[key].is_sufficient(allowed)
        )
        cache.update(zip(missing, self._evaluate_structures(list(missing), allowed), strict=True))
        evaluated = tuple(
            _make_evaluated(individual, by_number, cache[key], allowed)
            for (individual, _), by_number, key in zip(population, genes, keys, strict=True)
        )
        return evaluated, len(keys) - len(missing)

    def _check_lags(self) -> None:
        # The kernels do not check bounds: they would read samples of another signal or outside the record.
        channel, lag = max(self._gene_index.deepest), max(self._gene_index.deepest.values())
        if channel > self.record.inputs or lag > self.warm_up:
            self.clear_caches()
            if channel > self.record.inputs:
                raise RecordError(f"the genes use input {channel}, the record has {self.record.inputs}")
            raise SettingsError(f"the genes have lags up to {lag}, the settings allow {self.warm_up}")

    def _enforce_limits(self) -> None:
        if self._gene_index.bytes > self.limits.genes:
            self.clear_caches()
        if _STRUCTURE_BYTES * len(self._evaluations) > self.limits.structures:
            self._evaluations.clear()

    def evaluate_abandoned(self, abandoned: Sequence[Individual]) -> tuple[Individual, ...]:
        """Evaluate abandoned individuals completely."""
        return self.evaluate([(each, False) for each in abandoned])[0]

    def _evaluate_structures(self, keys: list[_Key], allowed: NDArray[np.float64]) -> list[Evaluation]:
        """Evaluate structures in batches that fit into the table of pairs."""
        structures = [sorted(numbers, key=self._gene_index.content) for numbers, _ in keys]
        largest = max(map(len, structures), default=0)
        pairs = (largest + 1) * (largest + 2) // 2
        if 2 * pairs > len(self._pairs.keys):
            # The table must have room for one individual, even if that exceeds the limit.
            self._pairs = pair_table(4 * pairs * PLACE_BYTES)
        places = len(self._pairs.keys)
        batch = max(1, places // 2 // pairs)
        evaluations: list[Evaluation] = []
        for begin in range(0, len(keys), batch):
            part = slice(begin, begin + batch)
            if int(self._pairs.taken[0]) + pairs * len(keys[part]) > places * 3 // 4:
                clear(self._pairs)
            evaluations += self._call_kernel(
                structures[part], [pruned for _, pruned in keys[part]], allowed, largest
            )
        return evaluations

    def _call_kernel(
        self, structures: list[list[int]], pruned: list[bool], allowed: NDArray[np.float64], largest: int
    ) -> list[Evaluation]:
        count = len(structures)
        numbers = np.zeros((count, largest), np.int64)
        for row, structure in zip(numbers, structures, strict=True):
            row[: len(structure)] = structure
        results = kernel.empty_results(count, largest)
        kernel.evaluate(
            numbers,
            np.array([len(structure) for structure in structures], np.int64),
            np.array(pruned, np.bool_),
            allowed * self._predicted,
            self.context,
            results,
        )
        evaluations = []
        for structure, positions, length, parameters, squares, code in zip(
            structures,
            *(array.tolist() for array in results),
            strict=True,
        ):
            remaining = tuple([structure[position] for position in positions[:length]])
            outcome = self._outcomes[code]
            evaluations.append(
                Evaluation(
                    remaining,
                    tuple([self._gene_index.regressor(number) for number in remaining]),
                    tuple(parameters[:length]) if outcome is OK else (),
                    float(allowed[length]) if outcome is _ABANDONED else squares / self._predicted,
                    outcome,
                )
            )
        return evaluations


def _make_evaluated(
    individual: Individual, genes: dict[int, Expression], evaluation: Evaluation, allowed: NDArray[np.float64]
) -> Individual:
    kept = tuple([gene for number, gene in genes.items() if number in evaluation.numbers])
    if evaluation.exceeds(allowed):
        return Individual(kept, evaluation.regressors, (), inf, _ABANDONED)
    terms, theta = evaluation.regressors, evaluation.theta
    return Individual(kept or individual.genes, terms, theta, evaluation.fitness, evaluation.outcome)
