"""Index of the genes of a search: their numbers, and the numbers of their regressors."""

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from islands.estimation.constraints.conditions import Constraint
from islands.evolution.gene_structure import LINEAR_OUTPUT, Structure, free, is_linear_output, with_phi
from islands.evolution.individual import make_regressor
from islands.expressions.tree import Apply, Constant, Expression, Lagged, Primitive, Shift, Symbol, children
from islands.kernels.breeding import Individuals, empty_individuals
from islands.kernels.codegen import NodeArrays
from islands.kernels.gene_table import NO_ROOM, UNKNOWN, empty_table, number_code
from islands.kernels.parameter_reduction import Groups
from islands.kernels.population import SelectedTerms
from islands.models.regressor import CanonicalForms, Regressor
from islands.program.term_pool import Term, TermPool

#: Approximate size of a gene in the index, in bytes.
_GENE_BYTES = 700

#: Approximate size of a regressor with its nodes, in bytes.
_REGRESSOR_BYTES = 1_600

#: Number of a regressor that is identically zero, or whose parameter is zero under the constraint.
ZERO = -1

#: A node without its arguments: a leaf, the samples of a back-shift, or a primitive and its number of
#: arguments.
Symbolic = Lagged | Constant | Symbol | int | tuple[Primitive, int]


class GeneIndex:
    """Genes in prefix code, their regressors, and the constraint group and weight of each regressor.

    Numbers are assigned in the order of insertion, so results must not depend on them.

    Parameters
    ----------
    constraint : Constraint
    targets : sequence of Term
        Terms that receive the first numbers.
    root_rule : bool
        Whether the linear output terms have to converge at constant input if the constraint fixes their sum.
    structure : callable
        Repair of new genes; an entry of ``STRUCTURES``.
    """

    def __init__(
        self,
        constraint: Constraint,
        targets: Sequence[Term],
        root_rule: bool = True,
        structure: Structure = free,
    ) -> None:
        self._constraint, self._structure = constraint, structure
        self._store = TermPool()
        self._regressors: dict[int, Regressor] = {}
        self._symbols: dict[Symbolic, int] = {}
        self._symbolic: list[Symbolic] = []
        self._has_leading = bool(constraint.sums)
        self._required = constraint.required
        #: Genes in the layout of the kernels.
        self.table = empty_table(1 << 10, np.zeros(64, np.int64), self._has_leading + len(self._required))
        self._known: dict[Expression, int] = {}
        #: Genes by number.
        self.genes: list[Expression] = []
        # The genes are kept, so that no other object has their identity.
        self._identities: dict[int, int] = {}
        #: Parts of genes, by symbol and identities of the arguments.
        self._parts: dict[tuple[int, ...], Expression] = {}
        self._canonical = CanonicalForms()
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
        return len(self.genes) * _GENE_BYTES + len(self._regressors) * _REGRESSOR_BYTES

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

    def symbol(self, symbolic: Symbolic, arity: int) -> int:
        """Return the number of a node without its arguments; add it if it is new."""
        known = self._symbols.get(symbolic)
        if known is None:
            known = self._symbols[symbolic] = len(self._symbolic)
            self._symbolic.append(symbolic)
            if known == self.table.arity.size:
                self.table = self.table._replace(arity=np.append(self.table.arity, np.zeros(known, np.int64)))
            self.table.arity[known] = arity
        return known

    def number_gene(self, gene: Expression) -> int:
        """Return the number of a gene; add the gene if it is new."""
        known = self._identities.get(id(gene), UNKNOWN)
        if known == UNKNOWN:
            known = self._known.get(gene, UNKNOWN)
        if known == UNKNOWN:
            code = np.array(self._encode(gene), np.int64)
            while (known := int(number_code(code, self.table))) == NO_ROOM:
                self.grow()
            self._decode_new()
        if self.table.term[known] == UNKNOWN:
            self._add_term(known, self.genes[known])
        return known

    def number_genes(self, structures: Sequence[Sequence[Expression]], most: int = 0) -> Individuals:
        """Return the numbers of the genes of individuals, with room for some number of genes at least."""
        known = self._identities.get
        numbers = [known(id(gene), UNKNOWN) for genes in structures for gene in genes]
        if UNKNOWN in numbers or UNKNOWN in self.table.term[numbers]:
            numbers = [self.number_gene(gene) for genes in structures for gene in genes]
        lengths = np.array([len(genes) for genes in structures], np.int64)
        found = empty_individuals(len(structures), max([most, *lengths.tolist()]))
        found.genes[np.arange(found.genes.shape[1]) < lengths[:, None]] = numbers
        return Individuals(found.genes, lengths)

    def index_of(self, gene: Expression) -> int:
        """Return the number of a gene's regressor, or `ZERO`; add the gene if it is new."""
        return int(self.table.term[self.number_gene(gene)])

    def required_genes(self) -> tuple[list[int], list[bool]]:
        """Return a gene for each requirement of the constraint, and whether it comes first in a structure."""
        leading = [LINEAR_OUTPUT] if self._has_leading else []
        genes = [*leading, *(with_phi(terms[0].expression) for terms in self._required)]
        return [self.number_gene(gene) for gene in genes], [gene in leading for gene in genes]

    def repair(self, genes: Iterable[Expression]) -> list[int]:
        """Return the numbers of some genes after the repair of their structure."""
        numbers = [self.number_gene(gene) for gene in genes]
        self.complete()
        found: list[int] = self.table.repaired[numbers].tolist()
        return found

    def complete(self) -> None:
        """Compute the properties of the genes that the kernels have added."""
        self._decode_new()
        for gene in np.flatnonzero(self.table.repaired[: len(self.genes)] == UNKNOWN).tolist():
            self.table.repaired[gene] = self.number_gene(self._structure(self.genes[gene]))

    def grow(self) -> None:
        """Double the room for genes."""
        table = self.table
        count = table.repaired.size
        larger = empty_table(2 * count, table.arity, table.meets.shape[1])
        for begin, end in pairwise(table.start[: table.taken[0] + 1].tolist()):
            number_code(table.symbols[begin:end], larger)
        larger.repaired[:count], larger.term[:count] = table.repaired, table.term
        larger.meets[:count] = table.meets
        self.table = larger

    def regressors(self, numbers: Iterable[int]) -> tuple[Regressor, ...]:
        """Return the regressors with some numbers."""
        return tuple(map(self._regressors.__getitem__, numbers))

    def sort_by_content(self, structures: NDArray[np.int64]) -> SelectedTerms:
        """Return structures, with `ZERO` for no term, with the terms in the order of their content."""
        numbers = np.unique(structures)
        ordered = sorted(
            numbers[numbers != ZERO].tolist(), key=lambda number: self._regressors[number].content
        )
        ranks = np.full(len(self._store) + 1, len(ordered))  # the last element is the rank of ZERO
        ranks[ordered] = np.arange(len(ordered))
        ranked = np.sort(ranks[structures], axis=1)
        terms = np.array([*ordered, 0], np.int64)[ranked]
        return SelectedTerms(terms, (structures != ZERO).sum(axis=1))

    def _encode(self, gene: Expression) -> list[int]:
        below = children(gene)
        match gene:
            case Shift(samples, _):
                code = [self.symbol(samples, 1)]
            case Apply(primitive, _):
                code = [self.symbol((primitive, len(below)), len(below))]
            case _:
                code = [self.symbol(gene, 0)]
        for child in below:
            code += self._encode(child)
        return code

    def _decode_new(self) -> None:
        """Make the expressions of the genes that the table has in addition."""
        begin, end = len(self.genes), int(self.table.taken[0])
        starts = self.table.start[begin : end + 1].tolist()
        symbols = self.table.symbols[starts[0] : starts[-1]].tolist()
        for number, gene in enumerate(self._decode(symbols), start=begin):
            self.genes.append(gene)
            self._known[gene] = self._identities[id(gene)] = number

    def _decode(self, symbols: list[int]) -> list[Expression]:
        """Return the genes of some codes, one after the other; equal parts of genes are one object."""
        found: list[Expression] = []
        for symbol in reversed(symbols):
            symbolic = self._symbolic[symbol]
            match symbolic:
                case int() | (_, 1):
                    below: tuple[Expression, ...] = (found.pop(),)
                case (_, arity):
                    below = tuple([found.pop() for _ in range(arity)])
                case leaf:
                    found.append(leaf)
                    continue
            key = symbol, *map(id, below)
            part = self._parts.get(key)
            if part is None:
                part = Shift(symbolic, *below) if isinstance(symbolic, int) else Apply(symbolic[0], below)
                self._parts[key] = part
            found.append(part)
        found.reverse()
        return found

    def _add_term(self, number: int, gene: Expression) -> None:
        """Compute the regressor of a gene, and the requirements that the gene meets."""
        regressor = make_regressor(gene, self._canonical)
        met = [regressor in terms for terms in self._required]
        self.table.meets[number] = [is_linear_output(gene), *met] if self._has_leading else met
        self.table.term[number] = self._add(regressor)

    def _add(self, regressor: Regressor | None) -> int:
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
