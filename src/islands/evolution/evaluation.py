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

from islands.errors import RecordError, SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.evolution.gene_index import ZERO, GeneIndex
from islands.evolution.gene_structure import STRUCTURES
from islands.evolution.individual import Individual
from islands.evolution.offspring import Offspring, Parents
from islands.evolution.settings import ERR_TARGETS, FITNESSES, Settings
from islands.evolution.structure_table import UNKNOWN, StructureTable
from islands.expressions.tree import Lagged
from islands.kernels import population as kernel
from islands.kernels.breeding import UNUSED, Individuals
from islands.kernels.pair_table import PLACE_BYTES, clear, complete_pairs, pair_table
from islands.program.regressor_matrix import select_rows
from islands.records.dataset import Dataset
from islands.simulation.layout import layout
from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.simulation.predictors import find_divergence_bound

#: Indices of y(k) and y(k-1), the first terms of every gene index.
_TARGET = 0
_PREVIOUS = 1

#: Binary digits of an error. Structures that are equal but for rounding have equal errors, so that rounding
#: does not decide between them.
_BITS = 33

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

#: Approximate size of a cached selection of terms, in bytes.
_SELECTION_BYTES = 300

#: Numbers of the terms of an individual in ascending order, and the decision whether to prune it, as bytes.
_Key = bytes


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
        self._bound = find_divergence_bound(record)
        self._rows = select_rows(record, self.warm_up)
        self._constraint = constraint(settings.constraints)
        self._outcomes = _OUTCOMES | {
            kernel.INFEASIBLE: EvaluationOutcome(Status.INFEASIBLE, self._constraint.lacking),
        }
        self._pairs = pair_table(self.limits.pairs)
        # More than half of the pruned individuals have the terms of an earlier one.
        self._selections: dict[_Key, int] = {}
        self._structures = StructureTable()
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
        return self._structures.bytes + _SELECTION_BYTES * len(self._selections)

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
        # Offspring still read the old table.
        self._selections, self._structures = {}, StructureTable()

    def evaluate(
        self, population: Sequence[tuple[Individual, bool]], thresholds: Sequence[float] | None = None
    ) -> tuple[Offspring, int]:
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
        individuals : Offspring
            The evaluated individuals in the same order, without the genes that were removed.
        duplicates : int
            Number of individuals whose terms, after pruning, occur earlier in the population or in the cache.
        """
        self.prepare()
        individuals = self._gene_index.number_genes([individual.genes for individual, _ in population])
        pruned = np.array([pruned for _, pruned in population], np.bool_)
        return self.evaluate_genes(individuals, pruned, thresholds)

    def evaluate_genes(
        self, individuals: Individuals, pruned: NDArray[np.bool_], thresholds: Sequence[float] | None = None
    ) -> tuple[Offspring, int]:
        """Evaluate individuals of the gene index; see `evaluate`."""
        self._check_lags()
        terms, structures = self._number_terms(individuals.genes), self._structures
        largest = max(terms.shape[1], len(thresholds or ()))
        allowed = np.full(largest + 1, inf)
        if thresholds is not None and self.abandon:
            allowed[: len(thresholds)] = thresholds
        places = self._find_structures(terms, pruned)
        found = np.unique(places)
        known, lower = structures.status[found], structures.fitness[found]
        insufficient = (known == kernel.ABANDONED) & (lower < allowed[structures.lengths[found]])
        missing = found[(known == UNKNOWN) | insufficient]
        self._evaluate_structures(missing, allowed)
        limits = allowed[structures.lengths[places]]
        known, fitness = structures.status[places], structures.fitness[places]
        simulated = (known == kernel.OK) | (known == kernel.DIVERGED)
        abandoned = (known == kernel.ABANDONED) | (simulated & (fitness > limits))
        genes = self._keep_genes(individuals, terms, places, abandoned)
        evaluated = Offspring(self._gene_index, structures, self._outcomes, genes, places, abandoned)
        return evaluated, len(places) - len(missing)

    def _find_structures(self, terms: NDArray[np.int64], pruned: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Return the numbers of the structures that pruning and constraints leave of some terms."""
        ordered, selections = np.sort(terms, axis=1), self._selections
        keys = list(map(bytes, np.column_stack([ordered, pruned]).astype(np.int32)))
        unknown = {key: place for place, key in enumerate(keys) if key not in selections}
        places = np.array(list(unknown.values()), np.int64)
        selections.update(zip(unknown, self._select_terms(ordered[places], pruned[places]), strict=True))
        return np.array([selections[key] for key in keys], np.int64)

    def _keep_genes(
        self,
        individuals: Individuals,
        terms: NDArray[np.int64],
        places: NDArray[np.int64],
        abandoned: NDArray[np.bool_],
    ) -> Individuals:
        """Return the genes whose terms remain; of an individual that fails without terms, all genes."""
        genes, most = individuals.genes, int(individuals.lengths.max(initial=0))
        kept = np.zeros(genes.shape, np.bool_)
        chosen = self._structures.terms[places]
        for column in range(int(self._structures.lengths[places].max(initial=0))):
            kept[:, :most] |= terms[:, :most] == chosen[:, column : column + 1]
        nothing = ~kept.any(axis=1) & ~abandoned
        kept[nothing] = genes[nothing] != UNUSED
        lengths = kept.sum(axis=1)
        found = np.full_like(genes, UNUSED)
        found[np.arange(genes.shape[1]) < lengths[:, None]] = genes[kept]
        return Individuals(found, lengths)

    def read(self, individuals: Sequence[Individual]) -> Parents:
        """Return evaluated individuals as arrays; valid until `prepare` is called."""
        if isinstance(individuals, Offspring) and individuals.structures is self._structures:
            return individuals.parents
        genes = self._gene_index.number_genes(
            [individual.genes for individual in individuals], self.settings.max_terms
        )
        terms = self._number_terms(genes.genes)
        terms[[not individual.regressors for individual in individuals]] = ZERO
        return Parents(
            genes,
            np.array(self._structures.number(self._gene_index.sort_by_content(terms)), np.int64),
            np.array([individual.fitness for individual in individuals], np.float64),
            np.array(
                [individual.outcome.verdict is Status.ABANDONED for individual in individuals], np.bool_
            ),
        )

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

    def evaluate_abandoned(self, abandoned: Sequence[Individual]) -> Offspring:
        """Evaluate abandoned individuals completely."""
        return self.evaluate([(each, False) for each in abandoned])[0]

    def _select_terms(self, ordered: NDArray[np.int64], pruned: NDArray[np.bool_]) -> list[int]:
        """Return the structures that pruning and constraints leave of individuals."""
        remaining: list[int] = []
        for part, given in self._make_batches(self._gene_index.sort_by_content(ordered)):
            selected = kernel.empty_terms(*given.terms.shape)
            kernel.select_terms(given, pruned[part], self.context, selected)
            remaining += self._structures.number(selected)
        return remaining

    def _evaluate_structures(self, numbers: NDArray[np.int64], allowed: NDArray[np.float64]) -> None:
        """Estimate and simulate the models of some structures."""
        structures, limits = self._structures, allowed * (1.0 + 2.0**-_BITS) * self._predicted
        for part, given in self._make_batches(structures.select(numbers)):
            places, (count, most) = numbers[part], given.terms.shape
            results = kernel.empty_results(count, most)
            self._run_kernel(given, limits, results)
            structures.theta[places, :most], structures.status[places] = results.theta, results.status
            structures.fitness[places] = np.where(
                results.status == kernel.ABANDONED,
                allowed[given.lengths],
                _remove_rounding(results.error / self._predicted),
            )

    def _run_kernel(
        self, given: kernel.SelectedTerms, limits: NDArray[np.float64], results: kernel.PopulationResults
    ) -> None:
        """Evaluate individuals; each thread writes other rows of the results."""
        count, context = len(given.lengths), self.context
        parts = max(1, min(self._threads, count * self._predicted // _THREAD_SAMPLES))

        def evaluate(part: int) -> None:
            rows = slice(count * part // parts, count * (part + 1) // parts)
            some = kernel.SelectedTerms(*(array[rows] for array in given))
            own = kernel.PopulationResults(results.theta[rows], results.error[rows], results.status[rows])
            kernel.evaluate_individuals(some, limits, context, own)

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


def _remove_rounding(errors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return errors with `_BITS` binary digits, whatever their unit."""
    mantissa, exponent = np.frexp(errors)
    found: NDArray[np.float64] = np.ldexp(np.rint(mantissa * 2.0**_BITS), exponent - _BITS)
    return found
