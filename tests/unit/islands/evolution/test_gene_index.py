"""Index of genes: their numbers, the numbers of their regressors, and the order of these."""

from islands.estimation.parameter_constraints import constraint
from islands.evolution.gene_index import ZERO, GeneIndex
from islands.evolution.gene_structure import phi
from islands.expressions.parsing import parse
from islands.expressions.printing import plain
from islands.expressions.tree import Constant, Lagged

TEXTS = ("u(k-2)", "y(k-1)*u(k-1)", "2*u(k-2)", "y(k-1)", "tanh(u(k-1))")


def make_index():
    return GeneIndex(constraint("none"), (Lagged(0, 0), Lagged(0, 1)))


def test_genes_of_one_regressor_have_one_term():
    index, genes = make_index(), [parse(text) for text in TEXTS]
    terms = [index.index_of(gene) for gene in [*genes, Constant(0.0)]]
    assert terms[0] == terms[2]
    assert terms[-1] == ZERO
    assert len({*terms}) == 5
    assert [item.text for item in index.regressors(terms[3:5])] == ["y(k-1)", "tanh(u1(k-1))"]


def test_equal_parts_of_genes_are_one_object():
    index = GeneIndex(constraint("none"), (Lagged(0, 0), Lagged(0, 1)), structure=phi)
    texts = "phi1(q2(u(k-1)), u(k-1))*y(k-1)", "tanh(phi1(q2(u(k-1)), u(k-1)))", "q2(u(k-1))"
    product, function, lag = (index.genes[index.number_gene(parse(text))] for text in texts)
    assert product.arguments[0] is function.arguments[0]
    assert product.arguments[0].arguments[0] is lag
    # The repair of a valid gene finds the gene itself.
    assert phi(product) is product
    assert index.repair([product]) == [index.number_gene(product)]
    assert phi(parse("tanh(phi1(y(k-1), u(k-1)))")) == parse("tanh(phi1(u(k-1), u(k-1)))")


def test_numbers_of_genes_remain_when_the_table_grows():
    index = make_index()
    genes = [parse(f"y(k-{one})*u(k-{other})") for one in range(1, 51) for other in range(1, 51)]
    room = index.table.repaired.size
    numbers = [index.number_gene(gene) for gene in genes]
    assert index.table.repaired.size > room
    assert index.table.arity.size > 64
    assert [index.number_gene(parse(plain(gene))) for gene in genes] == numbers
