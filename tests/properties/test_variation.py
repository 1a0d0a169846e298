"""Laws of variation: children of legal parents are legal, whoever they are."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.generation.evaluation import Evaluator
from islands.evolution.generation.variation import (
    high_level_crossover,
    inner_mutation,
    low_level_crossover,
    outer_mutation,
    random_gene,
    random_genes,
    repair_genes,
    with_linear_output,
)
from islands.evolution.gp.gene_structure import phi
from islands.evolution.gp.individual import Individual, make_regressor
from islands.evolution.gp.rng import Purpose, Stream
from islands.evolution.island import first_generation, step
from islands.evolution.problem import problem
from islands.evolution.settings import Settings
from islands.model.expression import Apply, Lagged, Shift, children, walk
from islands.model.parsing import parse
from islands.model.primitives import PRIMITIVES
from islands.model.rendering import plain
from support.searches import SMALL, record

# What is legal, said a second time and in other words than the source's.


def input_behind(argument):
    """The input under back-shifts alone, or None."""
    while isinstance(argument, Shift):
        argument = argument.argument
    return argument.channel if isinstance(argument, Lagged) and argument.channel > 0 else None


def bare_output(gene):
    """The lag of an output under back-shifts alone, or None."""
    lag = 0
    while isinstance(gene, Shift):
        lag, gene = lag + gene.samples, gene.argument
    return lag + gene.lag if isinstance(gene, Lagged) and gene.channel == 0 else None


def edges(gene):
    below = [edges(child) for child in children(gene)]
    return 1 + max(below) if below else 0


def deepest_lag(gene, above=0):
    match gene:
        case Lagged(_, lag):
            return above + lag
        case Shift(samples, argument):
            return deepest_lag(argument, above + samples)
    return max((deepest_lag(child, above) for child in children(gene)), default=0)


def faults(genes, setting, inputs):
    """Everything that is wrong with genes, as text."""
    found = []
    if not 1 <= len(genes) <= setting.max_terms:
        found.append(f"{len(genes)} genes")
    for gene in genes:
        text = plain(gene, inputs=2)
        if edges(gene) > setting.max_height:
            found.append(f"{text} is {edges(gene)} high")
        if deepest_lag(gene) > setting.maximum_lag:
            found.append(f"{text} reads {deepest_lag(gene)} back")
        for node in walk(gene):
            if isinstance(node, Lagged) and not 0 <= node.channel <= inputs:
                found.append(f"{text} reads input {node.channel}")
            if isinstance(node, Apply) and node.primitive.name in ("phi1", "phi2"):
                first, second = map(input_behind, node.arguments)
                if setting.structure != "free" and (first is None or first != second):
                    found.append(f"{text} has a phi of other things than lags of one input")
        if setting.structure == "increment" and bare_output(gene) not in (None, 1):
            found.append(f"{text} is a linear output that is not y(k-1)")
    if setting.constraints == "hysteresis" and all(bare_output(gene) is None for gene in genes):
        found.append("no linear y")
    return found


@st.composite
def setting_values(draw):
    max_terms, max_height = draw(st.integers(1, 6)), draw(st.integers(0, 5))
    fewest, most = sorted(draw(st.tuples(st.integers(1, max_terms), st.integers(1, max_terms))))
    shifts = tuple(draw(st.lists(st.integers(1, 5), max_size=3, unique=True)))
    primitives = draw(
        st.lists(st.sampled_from(["mul", "phi1", "phi2", "add", "tanh", "div"]), max_size=4, unique=True)
    )
    return Settings(
        max_terms=max_terms,
        max_height=max_height,
        initial_terms=(fewest, most),
        initial_height=draw(st.integers(0, max_height)),
        shifts=shifts or (() if primitives else (1,)),
        primitives=tuple(primitives),
        structure=draw(st.sampled_from(["free", "phi", "increment"])),
        constraints=draw(st.sampled_from(["none", "hysteresis"])),
        from_library=draw(st.sampled_from([0.0, 0.5, 1.0])),
    )


@st.composite
def legal_gene(draw, setting, inputs, limit=None):
    """A legal tree that owes nothing to the source's own generator."""
    limit = setting.max_height if limit is None else limit
    kinds = (
        ["leaf"] + ["shift"] * bool(limit and setting.shifts) + ["apply"] * bool(limit and setting.primitives)
    )
    below = legal_gene(setting, inputs, limit - 1)
    match draw(st.sampled_from(kinds)):
        case "leaf":
            gene = Lagged(draw(st.integers(0, inputs)))
        case "shift":
            gene = Shift(draw(st.sampled_from(setting.shifts)), draw(below))
        case _:
            primitive = PRIMITIVES[draw(st.sampled_from(setting.primitives))]
            if primitive.name in ("phi1", "phi2") and setting.structure != "free":
                leaf = Lagged(draw(st.integers(1, inputs)))
                steps = st.lists(st.sampled_from(setting.shifts or (0,)), max_size=limit - 1)
                arguments = []
                for _ in range(2):
                    argument = leaf
                    for samples in draw(steps) if setting.shifts else ():
                        argument = Shift(samples, argument)
                    arguments.append(argument)
            else:
                arguments = [draw(below) for _ in range(primitive.arity)]
            gene = Apply(primitive, tuple(arguments))
    return Lagged(0) if setting.structure == "increment" and bare_output(gene) else gene


@st.composite
def parents(draw, count):
    """Settings, a number of inputs, and legal individuals under them."""
    setting, inputs = draw(setting_values()), draw(st.integers(1, 2))
    made = []
    for _ in range(count):
        genes = draw(st.lists(legal_gene(setting, inputs), min_size=1, max_size=setting.max_terms))
        if setting.constraints == "hysteresis" and all(bare_output(gene) is None for gene in genes):
            genes[0] = Lagged(0)
        assert not faults(genes, setting, inputs)
        made.append(tuple(genes))
    return setting, inputs, made


seeds = st.integers(0, 2**32 - 1)


def stream(seed, purpose=Purpose.VARIATION):
    return Stream(seed, 0, 1, purpose)


# Every child of legal parents is legal.


@given(parents(2), seeds, st.sampled_from([low_level_crossover, high_level_crossover]))
def test_children_of_a_crossover_are_legal(drawn, seed, crossover):
    setting, inputs, (one, other) = drawn
    for child in crossover(one, other, setting, stream(seed)):
        assert faults(with_linear_output(child, setting), setting, inputs) == []


@given(parents(1), seeds)
def test_children_of_an_inner_mutation_are_legal(drawn, seed):
    setting, inputs, (genes,) = drawn
    child = inner_mutation(genes, setting, inputs, stream(seed))
    assert faults(with_linear_output(child, setting), setting, inputs) == []


@given(parents(1), seeds)
def test_children_of_an_outer_mutation_are_legal_with_a_pool_and_without(drawn, seed):
    setting, inputs, (genes,) = drawn
    # Of every height that fits: the pool of a problem holds no higher ones.
    pool = [Lagged(0), Lagged(inputs), *genes]
    for given_pool in ((), pool):
        child = outer_mutation(genes, setting, inputs, stream(seed), given_pool)
        assert faults(with_linear_output(child, setting), setting, inputs) == []


@given(parents(1), seeds)
def test_what_is_legal_is_left_as_it_is(drawn, seed):
    """So a step mends what is new alone: mending everybody again would change nobody."""
    setting, inputs, (genes,) = drawn
    assert repair_genes(genes, setting) == with_linear_output(genes, setting) == genes
    child = with_linear_output(outer_mutation(genes, setting, inputs, stream(seed), ()), setting)
    assert repair_genes(child, setting) == child


@given(parents(2), seeds)
def test_genes_from_elsewhere_are_made_legal(drawn, seed):
    """Those of settings that ask for nothing, under settings that do."""
    setting, inputs, individuals = drawn
    for structure in ("phi", "increment"):
        for genes in individuals:
            asked = replace(setting, structure=structure, constraints="hysteresis")
            assert faults(repair_genes(genes, asked), asked, inputs) == []


@given(setting_values(), st.integers(1, 2), seeds)
def test_first_individuals_are_legal_and_no_higher_than_a_first_gene_may_be(setting, inputs, seed):
    genes = random_genes(setting, inputs, stream(seed, Purpose.INITIAL))
    assert faults(genes, setting, inputs) == []
    gene = random_gene(setting, inputs, stream(seed))
    assert edges(gene) <= setting.initial_height
    used = {node.primitive.name for node in walk(gene) if isinstance(node, Apply)}
    assert used <= set(setting.primitives)
    assert {node.samples for node in walk(gene) if isinstance(node, Shift)} <= set(setting.shifts)


@pytest.mark.parametrize("library", ["phi-polynomial", "polynomial"])
@pytest.mark.parametrize("structure", ["phi", "increment"])
@pytest.mark.parametrize("max_height", [0, 1, 2, 4])
def test_a_library_s_genes_and_all_their_offspring_are_legal(library, structure, max_height):
    """Their leaves have lags of their own; their differences are phi functions wherever they end up."""
    setting = replace(
        SMALL,
        max_height=max_height,
        initial_height=min(3, max_height),
        library=library,
        library_degree=2,
        library_lags=3,
        from_library=0.6,
        structure=structure,
        shifts=(5,),
    )
    posed = problem(record(), setting)
    assert posed.pool
    assert [faults((gene, Lagged(0)), replace(setting, structure="phi"), 1) for gene in posed.pool] == [
        [] for _ in posed.pool
    ]
    evaluator = Evaluator(posed.record, setting)
    island, _ = first_generation(0, 5, evaluator, posed.seeds)
    for _ in range(6):
        island, _ = step(island, evaluator, posed.pool)
        for each in island.population:
            # Pruning and the constraint only take genes away; what is left was legal before.
            assert faults((Lagged(0), *each.genes)[: setting.max_terms], setting, 1) == []


def test_a_leaf_of_a_library_under_the_deepest_back_shifts_is_still_read_from_the_record():
    setting = replace(SMALL, library="phi-polynomial", library_lags=3, library_degree=1)
    assert setting.maximum_lag == 3 + 4 * 5
    deep = parse("q5(q5(q5(q5(u(k-3)))))")
    (evaluated,), _ = Evaluator(record(), setting).evaluate([(Individual((Lagged(0), deep)), False)])
    assert evaluated.outcome
    assert Evaluator(record(), SMALL).warm_up == 1 + 4 * 5


# The constraint of phi functions, Figure 3.


@pytest.mark.parametrize(
    ("broken", "mended"),
    [
        # The figure: a multiplication and y are forbidden, the back-shifts over them stay, u(k-2) and u(k-5).
        ("phi1(q1(u(k-1)*y(k-1)), q4(y(k-1)))", "phi1(q1(u(k-1)), q4(u(k-1)))"),
        ("phi2(q1(y(k-1)), q4(u(k-1)))", "phi2(q1(u(k-1)), q4(u(k-1)))"),
        ("phi1(y(k-1), q3(u(k-1)))", "phi1(u(k-1), q3(u(k-1)))"),
        ("phi1(q2(q1(q5(y(k-1)))), phi2(u(k-1), q1(u(k-1))))", "phi1(q2(q1(q5(u(k-1)))), u(k-1))"),
        ("y(k-1)*phi2(q2(u(k-1)), y(k-1))", "y(k-1)*phi2(q2(u(k-1)), u(k-1))"),
        ("q3(phi1(q1(y(k-1)), u(k-1)))", "q3(phi1(q1(u(k-1)), u(k-1)))"),
        ("tanh(phi1(u(k-1), y(k-1)*y(k-1)))", "tanh(phi1(u(k-1), u(k-1)))"),
        # Both arguments are lags of one input: the first one's, or the second's where the first has none.
        ("phi1(q1(u2(k-1)), q4(u1(k-1)))", "phi1(q1(u2(k-1)), q4(u2(k-1)))"),
        ("phi2(q1(y(k-1)), q4(u2(k-1)))", "phi2(q1(u2(k-1)), q4(u2(k-1)))"),
        # What is as it should be, or is no phi function, stays.
        ("phi1(q1(u2(k-1)), q4(u2(k-1)))", "phi1(q1(u2(k-1)), q4(u2(k-1)))"),
        ("y(k-1)*(y(k-1) - u(k-1))", "y(k-1)*(y(k-1) - u(k-1))"),
    ],
)
def test_a_phi_function_is_mended_as_in_figure_3(broken, mended):
    assert phi(parse(broken)) == parse(mended)
    assert phi(parse(mended)) == parse(mended)


def test_the_figure_s_term_is_the_paper_s():
    """Figure 3: "to form the model term phi(u(k-2), u(k-5))"."""
    mended = phi(parse("phi1(q1(u(k-1)*y(k-1)), q4(y(k-1)))"))
    assert make_regressor(mended).text == "u1(k-2) - u1(k-5)"
