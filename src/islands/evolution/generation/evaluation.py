"""Evaluation of individuals (the paper, section 5.2): prune, estimate under constraints, simulate.

An evaluator holds the record as the kernels want it, and caches. What it returns depends on the individuals,
the pruning decisions and the bars alone, never on what it has seen before.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np
from numpy.typing import NDArray

from islands.data.dataset import Dataset
from islands.errors import RecordError, SettingsError
from islands.estimation.parameter_constraints import CONSTRAINTS
from islands.evolution.gp.fitness import FITNESSES
from islands.evolution.gp.gene_index import ZERO, GeneIndex
from islands.evolution.gp.individual import Individual
from islands.evolution.settings import Settings
from islands.kernels import population as kernel
from islands.kernels.pair_table import PLACE_BYTES, clear, pair_table
from islands.model.expression import Expression, Lagged
from islands.model.regressor import Regressor
from islands.program.regressor_matrix import evaluate_terms
from islands.simulation.layout import layout
from islands.simulation.outcome import OK, EvaluationOutcome, Status
from islands.simulation.predictors import divergence_bound

#: y(k) is the first term of every vocabulary.
_TARGET = 0

_ABANDONED = EvaluationOutcome(Status.ABANDONED, "the error passed what the island keeps")

_DIVERGED = EvaluationOutcome(Status.DIVERGED, "an interval left the bound")

_OUTCOMES = {
    kernel.OK: OK,
    kernel.DIVERGED: _DIVERGED,
    kernel.ABANDONED: _ABANDONED,
    kernel.DEPENDENT: EvaluationOutcome(Status.SINGULAR, "the free directions depend on each other"),
    kernel.NO_TERMS: EvaluationOutcome(Status.INFEASIBLE, "no gene is left"),
    kernel.OVERFLOW: EvaluationOutcome(Status.DIVERGED, "a regressor overflows on the record"),
    kernel.TOO_FEW_ROWS: EvaluationOutcome(Status.TOO_FEW_ROWS, "there are as many parameters as rows"),
}


@dataclass(frozen=True, slots=True)
class Limits:
    """Bytes that the caches of an evaluator may take; a full one is emptied.

    Attributes
    ----------
    pairs : int
        Inner products of pairs of regressors; the table has at least room for an individual's.
    genes, structures : int
        Genes and their regressors, and evaluations that are remembered; what they take is estimated.
    """

    pairs: int = 1 << 25
    genes: int = 1 << 27
    structures: int = 1 << 27


#: Bytes that a remembered evaluation takes, about.
_STRUCTURE_BYTES = 1_500

_Key = tuple[frozenset[int], bool]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """What is known of a structure.

    Attributes
    ----------
    numbers, regressors : tuple
        The terms that pruning and constraints have left, in the order of their content.
    theta : tuple of float
        Their parameters; empty after a failure.
    fitness : float
        Of an abandoned one all that is known is that it is larger.
    outcome : EvaluationOutcome
    """

    numbers: tuple[int, ...]
    regressors: tuple[Regressor, ...]
    theta: tuple[float, ...]
    fitness: float
    outcome: EvaluationOutcome

    def settles(self, allowed: NDArray[np.float64]) -> bool:
        """Tell whether this is all that needs to be known under these bars."""
        return self.outcome is not _ABANDONED or self.fitness >= allowed[len(self.numbers)]

    def beyond(self, allowed: NDArray[np.float64]) -> bool:
        """Tell whether the error is beyond the bar; that of a divergence always is where there is one."""
        if self.outcome is _ABANDONED:
            return True
        simulated = self.outcome is OK or self.outcome is _DIVERGED
        return simulated and self.fitness > allowed[len(self.numbers)]


class Evaluator:
    """Evaluates individuals on one record.

    Parameters
    ----------
    record : Dataset
        Complete.
    settings : Settings
    limits : Limits, optional
    abandon : bool
        Whether bars are heeded. It changes how long a search takes, never whom it finds.
    """

    def __init__(
        self, record: Dataset, settings: Settings, limits: Limits | None = None, abandon: bool = True
    ) -> None:
        self.record, self.settings, self.limits, self.abandon = record, settings, limits or Limits(), abandon
        self.warm_up = settings.maximum_lag
        self._layout = layout(record, self.warm_up, FITNESSES[settings.fitness](settings.shooting))
        self._predicted = int(self._layout.length.sum())
        self._bound = divergence_bound(record)
        self._rows = evaluate_terms(record, self.warm_up)
        self._constraint = CONSTRAINTS[settings.constraints]
        self._outcomes = _OUTCOMES | {
            kernel.INFEASIBLE: EvaluationOutcome(Status.INFEASIBLE, self._constraint.lacking),
        }
        self._pairs = pair_table(self.limits.pairs)
        self._seen: dict[_Key, Evaluation] = {}
        self._vocabulary = self._empty()

    def _empty(self) -> GeneIndex:
        return GeneIndex(self._constraint, [Lagged(0, 0)])

    @property
    def memory(self) -> dict[str, tuple[int, int]]:
        """Bytes that every cache has in use, and its limit."""
        return {
            "pairs": (PLACE_BYTES * int(self._pairs.taken[0]), self.limits.pairs),
            "genes": (self._vocabulary.bytes, self.limits.genes),
            "structures": (_STRUCTURE_BYTES * len(self._seen), self.limits.structures),
        }

    def clear_caches(self) -> None:
        """Empty all caches."""
        clear(self._pairs)
        self._seen.clear()
        self._vocabulary = self._empty()

    def evaluate(
        self, population: Sequence[tuple[Individual, bool]], bars: Sequence[float] | None = None
    ) -> tuple[tuple[Individual, ...], int]:
        """Evaluate individuals, each with the decision whether it is pruned.

        Parameters
        ----------
        bars : sequence of float, optional
            For every size of a model, from 0 on, the fitness above which nobody needs to know it: the
            individual is then `Status.ABANDONED`, its simulation stopped as soon as it passes the bar, or
            diverges. One that is larger than all of these is never abandoned.

        Returns
        -------
        individuals : tuple of Individual
            In the same order; genes that did not survive are gone.
        duplicates : int
            How many have the structure of another one or of one seen before.
        """
        self._make_room()
        number = self._vocabulary.index_of
        genes: list[dict[int, Expression]] = []
        keys: list[_Key] = []
        for individual, pruned in population:
            found: dict[int, Expression] = {}
            for gene in individual.genes:
                found.setdefault(number(gene), gene)
            found.pop(ZERO, None)
            genes.append(found)
            keys.append((frozenset(found), pruned))
        self._refuse_unreadable()
        largest = max(map(len, genes), default=0)
        allowed = np.full(max(largest + 1, len(bars or ())), inf)
        if bars is not None and self.abandon:
            allowed[: len(bars)] = bars
        seen = self._seen
        fresh = dict.fromkeys(key for key in keys if key not in seen or not seen[key].settles(allowed))
        seen.update(zip(fresh, self._evaluated(list(fresh), allowed), strict=True))
        evaluated = tuple(
            _with(individual, found, seen[key], allowed)
            for (individual, _), found, key in zip(population, genes, keys, strict=True)
        )
        return evaluated, len(keys) - len(fresh)

    def _refuse_unreadable(self) -> None:
        # The kernels do not check: they would read another signal's samples, or none of the record's.
        channel, lag = max(self._vocabulary.deepest), max(self._vocabulary.deepest.values())
        if channel > self.record.inputs or lag > self.warm_up:
            self.clear_caches()
            if channel > self.record.inputs:
                raise RecordError(f"the genes read input {channel}, the record has {self.record.inputs}")
            raise SettingsError(
                f"the genes read {lag} samples back, the settings let them read {self.warm_up}"
            )

    def _make_room(self) -> None:
        if self._vocabulary.bytes > self.limits.genes:
            self.clear_caches()
        if _STRUCTURE_BYTES * len(self._seen) > self.limits.structures:
            self._seen.clear()

    def settled(self, abandoned: Sequence[Individual]) -> tuple[Individual, ...]:
        """Return individuals as if they had not been abandoned."""
        return self.evaluate([(each, False) for each in abandoned])[0]

    def _evaluated(self, keys: list[_Key], allowed: NDArray[np.float64]) -> list[Evaluation]:
        """Evaluate structures, as many in one call as the table of pairs has room for."""
        structures = [sorted(numbers, key=self._vocabulary.content) for numbers, _ in keys]
        most = max(map(len, structures), default=0)
        pairs = (most + 1) * (most + 2) // 2
        if 2 * pairs > len(self._pairs.keys):
            # Whatever the limit: a single individual has to find room.
            self._pairs = pair_table(4 * pairs * PLACE_BYTES)
        places = len(self._pairs.keys)
        at_once = max(1, places // 2 // pairs)
        found: list[Evaluation] = []
        for begin in range(0, len(keys), at_once):
            part = slice(begin, begin + at_once)
            if int(self._pairs.taken[0]) + pairs * len(keys[part]) > places * 3 // 4:
                clear(self._pairs)
            found += self._call(structures[part], [pruned for _, pruned in keys[part]], allowed, most)
        return found

    def _call(
        self, structures: list[list[int]], pruned: list[bool], allowed: NDArray[np.float64], most: int
    ) -> list[Evaluation]:
        count = len(structures)
        numbers = np.zeros((count, most), np.int64)
        for row, structure in zip(numbers, structures, strict=True):
            row[: len(structure)] = structure
        kept, lengths = np.empty((count, most), np.int64), np.empty(count, np.int64)
        theta, error, ending = np.empty((count, most)), np.empty(count), np.empty(count, np.int64)
        kernel.evaluate(
            numbers,
            np.array([len(structure) for structure in structures], np.int64),
            np.array(pruned, np.bool_),
            _TARGET,
            self.settings.tolerance,
            self._vocabulary.nodes,
            self._vocabulary.groups,
            self._pairs,
            self._rows,
            self._layout,
            self._bound,
            allowed * self._predicted,
            kept,
            lengths,
            theta,
            error,
            ending,
        )
        found = []
        for structure, positions, length, parameters, squares, code in zip(
            structures,
            kept.tolist(),
            lengths.tolist(),
            theta.tolist(),
            error.tolist(),
            ending.tolist(),
            strict=True,
        ):
            left = tuple([structure[position] for position in positions[:length]])
            outcome = self._outcomes[code]
            found.append(
                Evaluation(
                    left,
                    tuple([self._vocabulary.regressor(number) for number in left]),
                    tuple(parameters[:length]) if outcome is OK else (),
                    float(allowed[length]) if outcome is _ABANDONED else squares / self._predicted,
                    outcome,
                )
            )
        return found


def _with(
    individual: Individual, genes: dict[int, Expression], found: Evaluation, allowed: NDArray[np.float64]
) -> Individual:
    left = tuple([gene for number, gene in genes.items() if number in found.numbers])
    if found.beyond(allowed):
        return Individual(left, found.regressors, (), inf, _ABANDONED)
    return Individual(left or individual.genes, found.regressors, found.theta, found.fitness, found.outcome)
