"""Index of the genes of a search: it maps every gene to the number of its regressor."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from islands.estimation.constraints.conditions import Constraint
from islands.evolution.individual import make_regressor
from islands.expressions.tree import Expression
from islands.kernels.codegen import NodeArrays
from islands.kernels.parameter_reduction import Groups
from islands.models.regressor import Regressor
from islands.program.term_pool import Term, TermPool

#: Approximate size of a gene in the index, in bytes.
_GENE_BYTES = 700

#: Approximate size of a regressor with its nodes, in bytes.
_REGRESSOR_BYTES = 1_600

#: Number of a gene that is identically zero, or whose parameter is zero under the constraint.
ZERO = -1


class GeneIndex:
    """Genes, their regressors, and the constraint group and weight of each regressor.

    Numbers are assigned in the order of insertion, so results must not depend on them.

    Parameters
    ----------
    constraint : Constraint
    targets : sequence of Term
        Terms that receive the first numbers.
    root_rule : bool
        Whether the linear output terms have to converge at constant input if the constraint fixes their sum.
    """

    def __init__(self, constraint: Constraint, targets: Sequence[Term], root_rule: bool = True) -> None:
        self._constraint = constraint
        self._store = TermPool()
        self._known: dict[Expression, int] = {}
        self._regressors: dict[int, Regressor] = {}
        # The groups that every structure must contain come first.
        self._groups = {state: number for number, state in enumerate(constraint.sums)}
        self._group_sums = list(constraint.sums.values())
        self._group, self._weight = np.full(64, -1), np.zeros(64)
        self._targets = np.array([part.target for part in constraint.equalities], np.float64)
        self._coefficients = np.zeros((64, len(self._targets)))
        self._signs, self._sign = constraint.signs, np.zeros(64 if constraint.signs else 0)
        self._root_rule = root_rule and bool(constraint.sums)
        self._output_lag = np.zeros(64 if self._root_rule else 0, np.int64)
        self._arrays: Groups | None = None
        for target in targets:
            self._store.term(target)

    @property
    def bytes(self) -> int:
        """Approximate memory of the index, in bytes."""
        return len(self._known) * _GENE_BYTES + len(self._regressors) * _REGRESSOR_BYTES

    @property
    def deepest(self) -> Mapping[int, int]:
        """Largest lag of every channel in the regressors."""
        return self._store.deepest

    @property
    def nodes(self) -> NodeArrays:
        """Regressors in the layout of the kernels."""
        return self._store.nodes

    @property
    def groups(self) -> Groups:
        """Constraint in the layout of the kernels."""
        if self._arrays is None:
            sums = np.array(self._group_sums, np.float64)
            self._arrays = Groups(
                self._group,
                self._weight,
                sums,
                len(self._constraint.sums),
                self._coefficients,
                self._targets,
                self._sign,
                self._output_lag,
            )
        return self._arrays

    def index_of(self, gene: Expression) -> int:
        """Return the number of a gene's regressor, or `ZERO`; add the gene if it is new."""
        known = self._known.get(gene)
        if known is None:
            known = self._known[gene] = self._add(gene)
        return known

    def number_genes(self, genes: Iterable[Expression]) -> dict[int, Expression]:
        """Return genes by the number of their regressor, without those of the number `ZERO`.

        The first of several genes with one number is kept. New genes are added.
        """
        known, found = self._known, {}
        for gene in genes:
            number = known.get(gene)
            if number is None:
                number = known[gene] = self._add(gene)
            if number not in found:
                found[number] = gene
        found.pop(ZERO, None)
        return found

    def regressors(self, numbers: Iterable[int]) -> tuple[Regressor, ...]:
        """Return the regressors with some numbers."""
        return tuple(map(self._regressors.__getitem__, numbers))

    def rank(self, numbers: Iterable[int]) -> dict[int, int]:
        """Return the rank of each number in the order of the contents of the regressors."""
        ordered = sorted(numbers, key=lambda number: self._regressors[number].content)
        return {number: rank for rank, number in enumerate(ordered)}

    def _add(self, gene: Expression) -> int:
        regressor = make_regressor(gene)
        if regressor is None or not self._constraint.admits(regressor):
            return ZERO
        number = self._store.term(regressor)
        if number not in self._regressors:
            self._regressors[number] = regressor
            self._constrain(number, regressor)
        return number

    def _constrain(self, number: int, regressor: Regressor) -> None:
        if number >= len(self._group):
            self._group = np.append(self._group, np.full(number, -1))
            self._weight = np.append(self._weight, np.zeros(number))
            more = np.zeros((number, len(self._targets)))
            self._coefficients = np.vstack([self._coefficients, more])
            if self._signs:
                self._sign = np.append(self._sign, np.zeros(number))
            if self._root_rule:
                self._output_lag = np.append(self._output_lag, np.zeros(number, np.int64))
        self._coefficients[number] = self._constraint.weigh(regressor)
        if self._signs:
            self._sign[number] = self._signs.get(regressor, 0)
        if self._root_rule:
            self._output_lag[number] = regressor.output_lag
        weight, state = self._constraint.group(regressor)
        if weight:
            if state not in self._groups:
                self._groups[state] = len(self._group_sums)
                self._group_sums.append(0.0)
            self._group[number], self._weight[number] = self._groups[state], weight
        self._arrays = None
