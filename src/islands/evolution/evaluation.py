"""Evaluation of individuals (the paper, section 5.2): prune, estimate under constraints, simulate.

An evaluator holds the record in the layout of the kernels, and caches. Its results depend only on the
individuals, the pruning decisions and the abandon thresholds, never on earlier calls.
"""

from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.evolution.err_targets import ERR_TARGETS
from islands.evolution.fitness import FITNESSES
from islands.evolution.gene_index import ZERO, GeneIndex
from islands.evolution.gene_structure import STRUCTURES
from islands.evolution.individual import Individual
from islands.evolution.settings import Settings
from islands.expressions.tree import Expression, Lagged
from islands.kernels import population as kernel
from islands.kernels.breeding import UNUSED, Individuals
from islands.kernels.pair_table import PLACE_BYTES, clear, complete_pairs, pair_table
from islands.models.regressor import Regressor
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


#: Samples that a thread predicts at least: they take more than a millisecond, the start of a thread a tenth.
_THREAD_SAMPLES = 250_000

#: Approximate sizes of a cached evaluation and of a cached selection of terms, in bytes.
_EVALUATION_BYTES, _SELECTION_BYTES = 700, 250

#: Numbers of the terms of a structure in ascending order, and the decision whether to prune it, as bytes.
_Key = bytes

#: Terms that remain after pruning and constraints, ordered by content.
_Terms = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Cached evaluation of the terms that remain after pruning and constraints.

    Attributes
    ----------
    numbers, regressors : tuple
        The terms, ordered by content.
    theta : tuple of float
        Parameters of the terms; empty after a failure.
    fitness : float
        Mean squared error; a lower bound if the evaluation was abandoned.
    outcome : EvaluationOutcome
    """

    numbers: _Terms
    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...]
    fitness: float
    outcome: EvaluationOutcome

    def is_sufficient(self, allowed: Sequence[float]) -> bool:
        """Return whether this evaluation answers a request with these thresholds by size."""
        return self.outcome is not _ABANDONED or self.fitness >= allowed[len(self.numbers)]

    def exceeds(self, allowed: Sequence[float]) -> bool:
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
    threads : int
        Largest number of threads that evaluate the individuals of a long record.
    """

    def __init__(
        self,
        record: Dataset,
        settings: Settings,
        limits: Limits | None = None,
        abandon: bool = True,
        root_rule: bool = True,
        threads: int = 1,
    ) -> None:
        self._threads = threads
        self.record, self.settings, self.limits, self.abandon = record, settings, limits or Limits(), abandon
        self.warm_up = settings.maximum_lag
        self._layout = layout(record, self.warm_up, FITNESSES[settings.fitness](settings.shooting))
        self._predicted = int(self._layout.length.sum())
        self._bound = divergence_bound(record.y)
        self._rows = select_rows(record, self.warm_up)
        self._constraint = constraint(settings.constraints)
        self._outcomes = _OUTCOMES | {
            kernel.INFEASIBLE: EvaluationOutcome(Status.INFEASIBLE, self._constraint.lacking),
        }
        self._pairs = pair_table(self.limits.pairs)
        # More than half of the pruned individuals have the terms of an earlier one.
        self._selections: dict[_Key, _Terms] = {}
        self._evaluations: dict[_Terms, Evaluation] = {}
        self._root_rule = root_rule
        self._gene_index = self._empty_index()

    def _empty_index(self) -> GeneIndex:
        targets = Lagged(0, 0), Lagged(0, 1)
        return GeneIndex(self._constraint, targets, self._root_rule, STRUCTURES[self.settings.structure])

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
            "structures": (self._structure_bytes, self.limits.structures),
        }

    @property
    def _structure_bytes(self) -> int:
        return _EVALUATION_BYTES * len(self._evaluations) + _SELECTION_BYTES * len(self._selections)

    @property
    def gene_index(self) -> GeneIndex:
        """Index of the genes; valid until `prepare` or `evaluate` is called."""
        return self._gene_index

    def clear_caches(self) -> None:
        """Empty all caches."""
        clear(self._pairs)
        self._clear_structures()
        self._gene_index = self._empty_index()

    def _clear_structures(self) -> None:
        self._selections.clear()
        self._evaluations.clear()

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
            Number of individuals whose terms, after pruning, occur earlier in the population or in the cache.
        """
        self.prepare()
        individuals = self._gene_index.number_genes([individual.genes for individual, _ in population])
        return self.evaluate_genes(
            individuals, np.array([pruned for _, pruned in population], np.bool_), thresholds
        )

    def evaluate_genes(
        self, individuals: Individuals, pruned: NDArray[np.bool_], thresholds: Sequence[float] | None = None
    ) -> tuple[tuple[Individual, ...], int]:
        """Evaluate individuals of the gene index; see `evaluate`."""
        self._check_lags()
        terms = self._number_terms(individuals.genes)
        ordered = np.sort(terms, axis=1)
        largest = max(terms.shape[1], len(thresholds or ()))
        allowed = [inf] * (largest + 1)
        if thresholds is not None and self.abandon:
            allowed[: len(thresholds)] = thresholds
        selections, cache = self._selections, self._evaluations
        keys = list(map(bytes, np.column_stack([ordered, pruned])))
        unknown = {key: place for place, key in enumerate(keys) if key not in selections}
        places = np.array(list(unknown.values()), np.int64)
        selections.update(zip(unknown, self._select_terms(ordered[places], pruned[places]), strict=True))
        remaining = [selections[key] for key in keys]
        missing = list(
            dict.fromkeys(
                terms for terms in remaining if terms not in cache or not cache[terms].is_sufficient(allowed)
            )
        )
        cache.update(zip(missing, self._evaluate_terms(missing, allowed), strict=True))
        genes = self._gene_index.genes
        evaluated = tuple(
            [
                _make_evaluated(row, numbers, cache[kept], allowed, genes)
                for row, numbers, kept in zip(
                    individuals.genes.tolist(), terms.tolist(), remaining, strict=True
                )
            ]
        )
        return evaluated, len(keys) - len(missing)

    def _number_terms(self, genes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the number of the regressor of each gene; `ZERO` in place of numbers that occur before."""
        terms = np.where(genes == UNUSED, ZERO, self._gene_index.table.term[genes])
        for place in range(1, terms.shape[1]):
            repeated = (terms[:, :place] == terms[:, place : place + 1]).any(axis=1)
            terms[repeated, place] = ZERO
        return terms

    def _check_lags(self) -> None:
        # The kernels do not check bounds: they would read samples of another signal or outside the record.
        channel, lag = max(self._gene_index.deepest), max(self._gene_index.deepest.values())
        if channel > self.record.inputs or lag > self.warm_up:
            self.clear_caches()
            if channel > self.record.inputs:
                raise RecordError(f"the genes use input {channel}, the record has {self.record.inputs}")
            raise SettingsError(f"the genes have lags up to {lag}, the settings allow {self.warm_up}")

    def prepare(self) -> None:
        """Empty the caches that exceed their limit."""
        if self._gene_index.bytes > self.limits.genes:
            self.clear_caches()
        if self._structure_bytes > self.limits.structures:
            self._clear_structures()

    def evaluate_abandoned(self, abandoned: Sequence[Individual]) -> tuple[Individual, ...]:
        """Evaluate abandoned individuals completely."""
        return self.evaluate([(each, False) for each in abandoned])[0]

    def _select_terms(self, ordered: NDArray[np.int64], pruned: NDArray[np.bool_]) -> list[_Terms]:
        """Return the terms of structures that pruning and constraints leave."""
        remaining: list[_Terms] = []
        for part, given in self._make_batches(self._gene_index.sort_by_content(ordered)):
            selected = kernel.empty_terms(*given.terms.shape)
            kernel.select_terms(given, pruned[part], self.context, selected)
            remaining += _list_terms(selected)
        return remaining

    def _evaluate_terms(self, terms: Sequence[_Terms], allowed: Sequence[float]) -> list[Evaluation]:
        """Estimate and simulate models of these terms."""
        evaluations: list[Evaluation] = []
        limits = np.array(allowed) * self._predicted
        for part, given in self._make_batches(_make_selected(terms)):
            results = kernel.empty_results(*given.terms.shape)
            self._run_kernel(given, limits, results)
            for numbers, parameters, squares, code in zip(
                terms[part], *(array.tolist() for array in results), strict=True
            ):
                outcome, length = self._outcomes[code], len(numbers)
                evaluations.append(
                    Evaluation(
                        numbers,
                        self._gene_index.regressors(numbers),
                        tuple(parameters[:length]) if outcome is OK else (),
                        allowed[length] if outcome is _ABANDONED else squares / self._predicted,
                        outcome,
                    )
                )
        return evaluations

    def _run_kernel(
        self, given: kernel.SelectedTerms, limits: NDArray[np.float64], results: kernel.PopulationResults
    ) -> None:
        """Evaluate individuals; each thread writes other rows of the results."""
        count, context = len(given.lengths), self.context
        parts = max(1, min(self._threads, count * self._predicted // _THREAD_SAMPLES))

        def evaluate(part: int) -> None:
            rows = slice(count * part // parts, count * (part + 1) // parts)
            some = kernel.SelectedTerms(*(each[rows] for each in given))
            found = kernel.PopulationResults(results.theta[rows], results.error[rows], results.status[rows])
            kernel.evaluate_individuals(some, limits, context, found)

        if parts == 1:
            evaluate(0)
            return
        with ThreadPoolExecutor(parts) as threads:
            list(threads.map(evaluate, range(parts)))

    def _make_batches(self, structures: kernel.SelectedTerms) -> Iterator[tuple[slice, kernel.SelectedTerms]]:
        """Yield structures in batches whose inner products the table of pairs has room for, and has."""
        largest = max(structures.lengths.tolist(), default=0)
        pairs = (largest + 1) * (largest + 2) // 2
        if 2 * pairs > len(self._pairs.keys):
            # The table must have room for one individual, even if that exceeds the limit.
            self._pairs = pair_table(4 * pairs * PLACE_BYTES)
        places = len(self._pairs.keys)
        batch = max(1, places // 2 // pairs)
        for begin in range(0, len(structures.lengths), batch):
            part = slice(begin, begin + batch)
            # A kernel is compiled again for an array with gaps.
            terms = np.ascontiguousarray(structures.terms[part, :largest])
            given = kernel.SelectedTerms(terms, structures.lengths[part])
            if int(self._pairs.taken[0]) + pairs * len(given.lengths) > places * 3 // 4:
                clear(self._pairs)
            context = self.context
            complete_pairs(*given, context.target, context.nodes, context.pairs, context.rows)
            yield part, given


def _make_selected(structures: Sequence[_Terms]) -> kernel.SelectedTerms:
    lengths = np.array([len(each) for each in structures], np.int64)
    terms = np.zeros((len(structures), max(lengths.tolist(), default=0)), np.int64)
    for row, structure in zip(terms, structures, strict=True):
        row[: len(structure)] = structure
    return kernel.SelectedTerms(terms, lengths)


def _list_terms(selected: kernel.SelectedTerms) -> list[_Terms]:
    rows, lengths = (array.tolist() for array in selected)
    return [tuple(row[:length]) for row, length in zip(rows, lengths, strict=True)]


def _make_evaluated(
    row: list[int],
    numbers: list[int],
    evaluation: Evaluation,
    allowed: Sequence[float],
    genes: Sequence[Expression],
) -> Individual:
    chosen = evaluation.numbers
    kept = tuple([genes[gene] for gene, number in zip(row, numbers, strict=True) if number in chosen])
    if evaluation.exceeds(allowed):
        return Individual(kept, evaluation.regressors, (), inf, _ABANDONED)
    if not kept:
        kept = tuple([genes[gene] for gene in row if gene != UNUSED])
    return Individual(kept, evaluation.regressors, evaluation.theta, evaluation.fitness, evaluation.outcome)
