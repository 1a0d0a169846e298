"""The vocabulary of a search: every gene that it has met, as the number of its regressor."""

from collections.abc import Mapping, Sequence

import numpy as np

from islands.estimation.parameter_constraints import Constraint
from islands.evolution.gp.individual import make_regressor
from islands.kernels.codegen import Nodes
from islands.kernels.population import Groups
from islands.model.expression import Expression
from islands.model.regressor import Regressor
from islands.program.term_pool import Term, TermPool

#: Bytes that a gene takes, and a regressor with its nodes, about.
_GENE_BYTES, _REGRESSOR_BYTES = 700, 1_600

#: The number of a gene that is identically zero.
ZERO = -1


class GeneIndex:
    """Genes, their regressors, and what a constraint says of each.

    The numbers follow the order of arrival: nothing that is a result may depend on them.

    Parameters
    ----------
    constraint : Constraint
    targets : sequence of terms
        What has the first numbers.
    """

    def __init__(self, constraint: Constraint, targets: Sequence[Term]) -> None:
        self._constraint = constraint
        self._store = TermPool()
        self._known: dict[Expression, int] = {}
        self._regressors: dict[int, Regressor] = {}
        # Groups that a structure has to have come first.
        self._groups = {state: number for number, state in enumerate(constraint.sums)}
        self._wanted = list(constraint.sums.values())
        self._group, self._weight = np.full(64, -1), np.zeros(64)
        self._arrays: Groups | None = None
        for target in targets:
            self._store.term(target)

    @property
    def bytes(self) -> int:
        """What it takes, about."""
        return len(self._known) * _GENE_BYTES + len(self._regressors) * _REGRESSOR_BYTES

    @property
    def deepest(self) -> Mapping[int, int]:
        """The deepest lag of every channel that a regressor reads."""
        return self._store.deepest

    @property
    def nodes(self) -> Nodes:
        """The regressors as the kernels read them."""
        return self._store.nodes

    @property
    def groups(self) -> Groups:
        """The constraint as the kernels read it."""
        if self._arrays is None:
            wanted = np.array(self._wanted, np.float64)
            self._arrays = Groups(self._group, self._weight, wanted, len(self._constraint.sums))
        return self._arrays

    def index_of(self, gene: Expression) -> int:
        """Return the number of a gene's regressor, or `ZERO`."""
        known = self._known.get(gene)
        if known is None:
            known = self._known[gene] = self._learnt(gene)
        return known

    def regressor(self, number: int) -> Regressor:
        """Return the regressor of a number."""
        return self._regressors[number]

    def content(self, number: int) -> tuple[object, ...]:
        """Return the key that orders regressors."""
        return self._regressors[number].content

    def _learnt(self, gene: Expression) -> int:
        regressor = make_regressor(gene)
        if regressor is None:
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
        weight, state = self._constraint.group(regressor)
        if weight:
            if state not in self._groups:
                self._groups[state] = len(self._wanted)
                self._wanted.append(0.0)
            self._group[number], self._weight[number] = self._groups[state], weight
        self._arrays = None
