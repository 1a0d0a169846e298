"""Properties of variation: children of valid parents are valid."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from islands.evolution.evaluation import Evaluator
from islands.evolution.gene_structure import phi
from islands.evolution.generation import first_generation, step
from islands.evolution.problem import make_problem
from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings
from islands.evolution.variation import repair_genes
from islands.expressions.parsing import parse
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.printing import plain
from islands.expressions.tree import Apply, Lagged, Shift, children, walk
from support.searches import SMALL, record
from support.variation import breed_compiled

# Independent definition of valid genes.


def input_behind(argument):
    """Return the channel of an input under back-shifts, or None."""
    while isinstance(argument, Shift):
        argument = argument.argument
    return argument.channel if isinstance(argument, Lagged) and argument.channel > 0 else None


def bare_output(gene):
    """Return the lag of an output under back-shifts, or None."""
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
    """Return descriptions of all faults of genes."""
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
def valid_gene(draw, setting, inputs, limit=None):
    """Draw a valid tree, independently of the generator in the package."""
    limit = setting.max_height if limit is None else limit
    kinds = (
        ["leaf"] + ["shift"] * bool(limit and setting.shifts) + ["apply"] * bool(limit and setting.primitives)
    )
    below = valid_gene(setting, inputs, limit - 1)
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
    """Draw settings, a number of inputs, and valid individuals."""
    setting, inputs = draw(setting_values()), draw(st.integers(1, 2))
    made = []
    for _ in range(count):
        genes = draw(st.lists(valid_gene(setting, inputs), min_size=1, max_size=setting.max_terms))
        if setting.constraints == "hysteresis" and all(bare_output(gene) is None for gene in genes):
            genes[0] = Lagged(0)
        assert not faults(genes, setting, inputs)
        made.append(tuple(genes))
    return setting, inputs, made


seeds = st.integers(0, 2**32 - 1)


def stream(seed, purpose=Purpose.VARIATION):
    return Stream(seed, 0, 1, purpose)


# Children of valid parents are valid.


@given(parents(2), seeds, st.sampled_from([0.0, 1.0]))
def test_children_of_a_crossover_are_valid(drawn, seed, high_level):
    setting, inputs, couple = drawn
    recombining = replace(setting, crossover=1.0, high_level=high_level)
    for child in breed_compiled(couple, recombining, inputs, stream(seed)):
        assert faults(child, setting, inputs) == []


@given(parents(2), seeds)
def test_children_of_an_outer_mutation_are_valid(drawn, seed):
    setting, inputs, couple = drawn
    mutating = replace(setting, crossover=0.0, mutation=1.0, outer=1.0)
    # The pool of a problem has only genes within the height limit.
    pool = [Lagged(0), Lagged(inputs), *couple[0]]
    for given_pool in ((), pool):
        for child in breed_compiled(couple, mutating, inputs, stream(seed), given_pool):
            assert faults(child, setting, inputs) == []


@given(parents(2), seeds)
def test_repair_makes_genes_of_other_settings_valid(drawn, seed):
    """The genes come from unconstrained settings."""
    setting, inputs, individuals = drawn
    for structure in ("phi", "increment"):
        for genes in individuals:
            constrained = replace(setting, structure=structure, constraints="hysteresis")
            assert faults(repair_genes(genes, constrained), constrained, inputs) == []


@pytest.mark.parametrize("library", ["phi-polynomial", "polynomial"])
@pytest.mark.parametrize("structure", ["phi", "increment"])
@pytest.mark.parametrize("max_height", [0, 1, 2, 4])
def test_offspring_of_library_genes_are_valid(library, structure, max_height):
    """Library leaves have lags larger than one, and library differences are phi functions."""
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
    search_problem = make_problem(record(), setting)
    assert search_problem.pool
    assert [
        faults((gene, Lagged(0)), replace(setting, structure="phi"), 1) for gene in search_problem.pool
    ] == [[] for _ in search_problem.pool]
    evaluator = Evaluator(search_problem.record, setting)
    island, _ = first_generation(0, 5, evaluator, search_problem.seeds)
    for _ in range(6):
        island, _ = step(island, evaluator, search_problem.pool)
        for each in island.population:
            # Pruning and the constraint only remove genes.
            assert faults((Lagged(0), *each.genes)[: setting.max_terms], setting, 1) == []


# The constraint of phi functions, Figure 3.


@pytest.mark.parametrize(
    ("broken", "repaired"),
    [
        # Figure 3: multiplication and y are replaced, back-shifts are kept, giving u(k-2) and u(k-5).
        ("phi1(q1(u(k-1)*y(k-1)), q4(y(k-1)))", "phi1(q1(u(k-1)), q4(u(k-1)))"),
        ("phi2(q1(y(k-1)), q4(u(k-1)))", "phi2(q1(u(k-1)), q4(u(k-1)))"),
        ("phi1(y(k-1), q3(u(k-1)))", "phi1(u(k-1), q3(u(k-1)))"),
        ("phi1(q2(q1(q5(y(k-1)))), phi2(u(k-1), q1(u(k-1))))", "phi1(q2(q1(q5(u(k-1)))), u(k-1))"),
        ("y(k-1)*phi2(q2(u(k-1)), y(k-1))", "y(k-1)*phi2(q2(u(k-1)), u(k-1))"),
        ("q3(phi1(q1(y(k-1)), u(k-1)))", "q3(phi1(q1(u(k-1)), u(k-1)))"),
        ("tanh(phi1(u(k-1), y(k-1)*y(k-1)))", "tanh(phi1(u(k-1), u(k-1)))"),
        # Both arguments become lags of the input of the first, or of the second if the first has none.
        ("phi1(q1(u2(k-1)), q4(u1(k-1)))", "phi1(q1(u2(k-1)), q4(u2(k-1)))"),
        ("phi2(q1(y(k-1)), q4(u2(k-1)))", "phi2(q1(u2(k-1)), q4(u2(k-1)))"),
        # Valid phi functions and other functions are not changed.
        ("phi1(q1(u2(k-1)), q4(u2(k-1)))", "phi1(q1(u2(k-1)), q4(u2(k-1)))"),
        ("y(k-1)*(y(k-1) - u(k-1))", "y(k-1)*(y(k-1) - u(k-1))"),
    ],
)
def test_phi_functions_are_repaired_as_in_figure_3(broken, repaired):
    assert phi(parse(broken)) == parse(repaired)
    assert phi(parse(repaired)) == parse(repaired)
