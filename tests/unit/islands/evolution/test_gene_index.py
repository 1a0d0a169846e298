"""Index of genes: numbers of their regressors, and the order of these."""

from islands.estimation.parameter_constraints import constraint
from islands.evolution.gene_index import GeneIndex
from islands.expressions.parsing import parse
from islands.expressions.tree import Constant, Lagged

TEXTS = ("u(k-2)", "y(k-1)*u(k-1)", "2*u(k-2)", "y(k-1)", "tanh(u(k-1))")


def make_index():
    return GeneIndex(constraint("none"), (Lagged(0, 0), Lagged(0, 1)))


def test_genes_of_one_regressor_have_one_number_and_the_first_is_kept():
    index, genes = make_index(), [parse(text) for text in TEXTS]
    numbered = index.number_genes([*genes, Constant(0.0)])
    assert list(numbered.values()) == [genes[0], genes[1], genes[3], genes[4]]
    assert numbered == {index.index_of(gene): gene for gene in reversed(genes)}
    assert [item.text for item in index.regressors(numbered)][-2:] == ["y(k-1)", "tanh(u1(k-1))"]


def test_rank_does_not_depend_on_the_order_of_insertion():
    orders = []
    for texts in (TEXTS, TEXTS[::-1]):
        index = make_index()
        ranks = index.rank(index.number_genes([parse(text) for text in texts]))
        assert sorted(ranks.values()) == [0, 1, 2, 3]
        orders.append([item.text for item in index.regressors(sorted(ranks, key=ranks.__getitem__))])
    assert orders[0] == orders[1]
