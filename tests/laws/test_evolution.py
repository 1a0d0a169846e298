"""Laws of evolution: children are legal, steps are pure, elites do not get worse, caches change nothing."""

import hashlib
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from math import inf, isfinite, nan
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st

from islands.data.dataset import Dataset
from islands.evolution.archipelago import Archipelago
from islands.evolution.constraints import phi
from islands.evolution.engine import SerialEngine
from islands.evolution.evaluation import Evaluator
from islands.evolution.hall_of_fame import HallOfFame, with_entries
from islands.evolution.individual import Individual, distinct_genes, regressor_of
from islands.evolution.island import _elite, first_generation, step
from islands.evolution.problem import problem
from islands.evolution.rng import Purpose, Stream
from islands.evolution.selection import tournament
from islands.evolution.settings import Settings
from islands.evolution.variation import (
    high_level_crossover,
    inner_mutation,
    legal,
    low_level_crossover,
    outer_mutation,
    random_gene,
    random_genes,
)
from islands.io.checkpoints import write_checkpoint
from islands.model.clusters import steady_state
from islands.model.expression import Apply, Constant, Lagged, Shift, children, walk
from islands.model.parsing import parse
from islands.model.primitives import PRIMITIVES
from islands.model.text import plain
from islands.program.inner_products import InnerProducts

SMALL = Settings(
    population=24,
    generations=10,
    prune=0.3,
    tolerance=1e-4,
    max_terms=5,
    initial_terms=(1, 4),
    max_height=4,
    shooting=60,
)


def record(samples=400, inputs=1, seed=0):
    """A noisy hysteresis, the same bits on every call and in every process."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples) / 25
    u = np.column_stack([np.sin(time * (1 + 0.3 * i)) + 0.5 * np.sin(2.6 * time + i) for i in range(inputs)])
    y = np.zeros(samples)
    for k in range(2, samples):
        rise = u[k - 1] - u[k - 2]
        y[k] = y[k - 1] + np.sum(0.8 * rise - 0.3 * y[k - 1] * np.abs(rise))
    return Dataset(u, y + 1e-3 * rng.normal(size=samples), 0.04)


def evolved(generations, setting=SMALL, seed=3, evaluator=None):
    """One island after some generations."""
    evaluator = evaluator or Evaluator(record(), setting)
    island, _ = first_generation(0, seed, evaluator)
    for _ in range(generations):
        island, _ = step(island, evaluator)
    return island


def digest():
    """The hash of a checkpoint after ten generations of two islands, a library's genes among theirs."""
    setting = replace(
        SMALL, library="phi-polynomial", library_degree=3, from_library=0.5, structure="increment"
    )
    for epoch in SerialEngine().run(problem(record(), setting), 11, 2, Archipelago()):
        last = epoch.archipelago
    assert last.epoch == 10
    with tempfile.TemporaryDirectory() as folder:
        write_checkpoint(last, Path(folder) / "checkpoint.json", {})
        return hashlib.sha256((Path(folder) / "checkpoint.json").read_bytes()).hexdigest()


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
        assert faults(legal(child, setting), setting, inputs) == []


@given(parents(1), seeds)
def test_children_of_an_inner_mutation_are_legal(drawn, seed):
    setting, inputs, (genes,) = drawn
    child = legal(inner_mutation(genes, setting, inputs, stream(seed)), setting)
    assert faults(child, setting, inputs) == []


@given(parents(1), seeds)
def test_children_of_an_outer_mutation_are_legal_with_a_pool_and_without(drawn, seed):
    setting, inputs, (genes,) = drawn
    # Of every height that fits: the pool of a problem holds no higher ones.
    pool = [Lagged(0), Lagged(inputs), *genes]
    for given_pool in ((), pool):
        child = legal(outer_mutation(genes, setting, inputs, stream(seed), given_pool), setting)
        assert faults(child, setting, inputs) == []


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
    assert regressor_of(mended).text == "u1(k-2) - u1(k-5)"


# An individual recombines or mutates, never both.


def bred(**changes):
    setting = replace(SMALL, prune=0.0, constraints="none", structure="free", **changes)
    evaluator = Evaluator(record(), setting)
    island, _ = first_generation(0, 1, evaluator)
    following, _ = step(island, evaluator)
    return island, following


def test_who_recombined_does_not_mutate():
    """Every pair recombines by whole genes; a mutation, as sure as can be, would bring in new ones."""
    island, following = bred(crossover=1.0, high_level=1.0, mutation=1.0, outer=1.0)
    known = {gene for each in island.population for gene in each.genes}
    assert {gene for each in following.population for gene in each.genes} <= known
    assert [each.genes for each in following.population] != [each.genes for each in island.population]


def test_who_did_not_recombine_mutates_in_one_gene():
    island, following = bred(crossover=0.0, mutation=1.0, outer=1.0)
    known = {gene for each in island.population for gene in each.genes}
    fresh = [sum(gene not in known for gene in each.genes) for each in following.population]
    assert max(fresh) == 1
    assert sum(fresh) > len(fresh) / 2


def test_who_neither_recombines_nor_mutates_is_a_copy():
    island, following = bred(crossover=0.0, mutation=0.0)
    assert set(following.population) <= set(island.population)


# The same island steps to the same island.


def test_a_step_twice_gives_the_same_island():
    evaluator = Evaluator(record(), SMALL)
    island, _ = first_generation(0, 3, evaluator)
    first, second = step(island, evaluator), step(island, evaluator)
    assert first[0] == second[0]
    assert first[0] == step(island, Evaluator(record(), SMALL))[0]
    assert first[0] != island
    assert first[0].generation == 1


def test_an_evaluator_that_has_seen_others_changes_nothing():
    seasoned = Evaluator(record(), SMALL)
    evolved(3, seed=99, evaluator=seasoned)
    assert evolved(4, evaluator=seasoned) == evolved(4)


def test_cleared_and_overflowing_caches_change_nothing(monkeypatch):
    expected = evolved(4)
    regressor_of.cache_clear()
    steady_state.cache_clear()
    monkeypatch.setattr("islands.evolution.evaluation._REMEMBERED", 0)
    forgetful = Evaluator(record(), SMALL)
    known = [(Individual((Lagged(0),)), False)]
    assert [forgetful.evaluate(known)[1] for _ in range(3)] == [0, 0, 0]
    assert [Evaluator(record(), SMALL).evaluate(known * 2)[1] for _ in range(2)] == [1, 1]
    forgetful._products = InnerProducts(record(), forgetful.warm_up, limit=0)
    assert evolved(4, evaluator=forgetful) == expected


def test_ten_generations_give_the_same_bits_twice_and_in_other_processes():
    expected = digest()
    assert digest() == expected
    command = "import runpy, sys; print(runpy.run_path(sys.argv[1])['digest']())"
    running = [
        subprocess.Popen(
            [sys.executable, "-c", command, __file__],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONHASHSEED": hash_seed},
        )
        for hash_seed in ("1", "2")
    ]
    assert [process.communicate(timeout=120)[0].strip() for process in running] == [expected] * 2


def test_runs_of_other_seeds_differ():
    assert evolved(2, seed=3) != replace(evolved(2, seed=4), seed=3)


def test_every_stream_of_a_step_knows_its_island_and_its_generation():
    """Where all else is equal, other islands and other generations select, vary and prune otherwise."""
    for one_parent, changes in (
        (False, {"prune": 0.0, "crossover": 0.0, "mutation": 0.0}),
        (True, {"prune": 0.0, "crossover": 0.0, "mutation": 1.0}),
        (True, {"prune": 0.5, "crossover": 0.0, "mutation": 0.0, "tolerance": 0.01}),
    ):
        evaluator = Evaluator(record(), replace(SMALL, **changes))
        island = evolved(0, evaluator.settings, evaluator=evaluator)
        if one_parent:
            largest = max(island.population, key=lambda each: each.size)
            island = replace(island, population=(largest,), elite=(largest,))
        following = {
            step(replace(island, index=index, generation=generation), evaluator)[0].population
            for index in (0, 1)
            for generation in (0, 1)
        }
        assert len(following) == 4, changes


def test_parents_are_elite_and_offspring_together():
    evaluator = Evaluator(record(), replace(SMALL, prune=0.0, crossover=0.0, mutation=0.0, distinct=True))
    island = evolved(0, evaluator.settings, evaluator=evaluator)
    best, others = island.elite[:1], island.population[1:]
    only_in_elite = replace(island, elite=best, population=tuple(each for each in others if each != best[0]))
    following, _ = step(only_in_elite, evaluator)
    assert best[0] in following.population
    assert len(set(following.population)) > 3


def test_the_hall_of_an_island_remembers_what_its_population_has_lost():
    evaluator = Evaluator(record(), SMALL)
    island, _ = first_generation(0, 3, evaluator)
    expected = with_entries(HallOfFame(), island.population)
    for _ in range(4):
        assert island.hall == expected
        island, _ = step(island, evaluator)
        expected = with_entries(expected, island.population)
    alive = {each.key for each in island.population}
    assert any(entry.key not in alive for entry in island.hall.entries)


# Inner products and evaluations do not depend on company.

TERMS = [
    regressor_of(parse(text))
    for text in (
        "y(k-1)",
        "u(k-1)*y(k-2)*u(k-3)*y(k-4)*u(k-5)",
        "tanh(y(k-3)) - u(k-2)",
        "phi2(u(k-1), u(k-4))*exp(u(k-2))",
        "phi1(u(k-1), u(k-4))",
        "y(k-7)^2",
    )
]


@hypothesis_settings(max_examples=25)
@given(st.lists(st.lists(st.integers(0, 5), min_size=1, max_size=4, unique=True), min_size=1, max_size=5))
def test_cached_inner_products_equal_uncached_ones_bit_for_bit(batches):
    cache = InnerProducts(record(), 21)
    for batch in batches:
        structure = [TERMS[position] for position in batch]
        fresh = InnerProducts(record(), 21).gram(structure)
        assert np.array_equal(cache.gram(structure), fresh)
        assert np.array_equal(fresh, fresh.T)
    cache.prepare([TERMS])
    held = cache.bytes
    cache.gram(TERMS)
    # Six terms and the target: 28 pairs, none of them twice.
    assert cache.bytes == held == 28 * 200


def test_a_full_table_of_inner_products_is_emptied_and_gives_the_same():
    small, large = InnerProducts(record(), 21, limit=10 * 200), InnerProducts(record(), 21)
    for lag in range(1, 20):
        structure = [regressor_of(parse(f"u(k-{lag})")), regressor_of(parse(f"y(k-{lag})*u(k-1)"))]
        small.prepare([TERMS[:1], structure])
        assert np.array_equal(small.gram(structure), large.gram(structure))
        # Two and the target are six pairs; it may hold ten, and what a call adds to them.
        assert small.bytes <= (10 + 8) * 200
    assert large.bytes > 60 * 200


def test_a_batch_equals_one_by_one():
    population = [(each, bool(place % 3)) for place, each in enumerate(evolved(2).population)]
    together, duplicates = Evaluator(record(), SMALL).evaluate(population)
    alone = [Evaluator(record(), SMALL).evaluate([pair])[0][0] for pair in population]
    assert list(together) == alone
    backwards, others = Evaluator(record(), SMALL).evaluate(population[::-1])
    assert list(backwards[::-1]) == alone
    assert duplicates == others > 0


def test_the_pruning_decision_is_part_of_a_duplicate_s_key():
    genes = tuple(parse(text) for text in ("y(k-1)", "phi1(u(k-1), u(k-2))", "phi2(u(k-1), u(k-9))*y(k-3)"))
    each = Individual(genes)
    evaluator = Evaluator(record(), replace(SMALL, tolerance=1e-3))
    (whole, pruned), duplicates = evaluator.evaluate([(each, False), (each, True)])
    assert (whole.size, duplicates) == (3, 0)
    assert pruned.size < 3
    assert evaluator.evaluate([(each, True), (each, False), (each, True)]) == ((pruned, whole, pruned), 3)


def test_a_duplicate_consumes_the_same_draws():
    """Every individual draws its pruning, in order, known or not."""

    class Spy(Evaluator):
        decisions = ()

        def evaluate(self, population):
            self.decisions = [pruned for _, pruned in population]
            return super().evaluate(population)

    setting = replace(SMALL, prune=0.5, initial_terms=(1, 1), initial_height=0)
    spy = Spy(record(), setting)
    island, info = first_generation(0, 8, spy)
    draw = Stream(8, 0, 0, Purpose.PRUNING)
    assert spy.decisions == [draw.chance(0.5) for _ in range(setting.population)]
    # Leaves alone: hardly any individual is the first of its kind.
    assert info.duplicates >= setting.population - 8
    once_more, seen_before = first_generation(0, 8, spy)
    assert once_more == island
    assert seen_before.duplicates == setting.population


# Seeds, elites, failures.


def test_the_first_population_begins_with_the_seeds():
    setting = replace(SMALL, prune=0.0, library="phi-polynomial", library_degree=3, library_lags=3)
    posed = problem(record(), setting)
    assert [len(genes) for genes in posed.seeds] == sorted(len(genes) for genes in posed.seeds)
    assert len(posed.seeds) > 2
    island, _ = first_generation(0, 1, Evaluator(posed.record, setting), posed.seeds)
    for each, genes in zip(island.population, posed.seeds, strict=False):
        assert each.genes == genes
        assert set(each.regressors) == set(distinct_genes(genes))
    unseeded, _ = first_generation(0, 1, Evaluator(posed.record, setting))
    assert island.population[len(posed.seeds) :] == unseeded.population[: -len(posed.seeds)]


def test_seeds_are_mended_and_cut_like_everybody():
    setting = replace(SMALL, prune=0.0, max_terms=3, initial_terms=(1, 3))
    given_seeds = [
        (parse("phi1(y(k-1), q1(u(k-1)))"),),
        tuple(parse(f"phi1(u(k-1), u(k-{lag}))") for lag in (2, 3, 4, 5)),
    ]
    island, _ = first_generation(0, 1, Evaluator(record(), setting), given_seeds)
    assert island.population[0].genes == (Lagged(0), parse("phi1(u(k-1), q1(u(k-1)))"))
    assert island.population[1].genes == (Lagged(0), *given_seeds[1][:2])


def test_more_seeds_than_the_population_are_cut():
    setting = replace(SMALL, population=2)
    given_seeds = [(Lagged(0), parse(f"phi1(u(k-1), u(k-{lag}))")) for lag in (2, 3, 4)]
    island, _ = first_generation(0, 1, Evaluator(record(), setting), given_seeds)
    assert [each.genes for each in island.population] == given_seeds[:2]


@pytest.mark.parametrize("distinct", [False, True])
def test_the_elite_is_the_best_of_old_elite_and_offspring(distinct):
    setting = replace(SMALL, distinct=distinct, elite=0.25)
    evaluator = Evaluator(record(), setting)
    island, _ = first_generation(0, 3, evaluator)
    for _ in range(8):
        before = island
        island, _ = step(island, evaluator)
        fitness = [each.fitness for each in island.elite]
        assert fitness == sorted(fitness)
        assert fitness[0] <= before.elite[0].fitness
        union = (*before.elite, *island.population)
        if distinct:
            assert len({each.key for each in island.elite}) == len(island.elite)
            best = sorted({each.key: each.fitness for each in union}.values())
        else:
            assert len(island.elite) == 6
            best = sorted(each.fitness for each in union)
        assert fitness == best[: len(fitness)]
        assert len(island.population) == setting.population


def test_ties_for_the_elite_go_to_the_smaller_then_to_the_structure_s_text():
    def each(*texts):
        regressors = tuple(regressor_of(parse(text)) for text in texts)
        return Individual(tuple(map(parse, texts)), regressors, (1.0,) * len(texts), 0.5)

    large, late, early = each("y(k-1)", "u(k-1)"), each("y(k-3)"), each("y(k-2)")
    assert _elite((large, late, early), 3, False) == (early, late, large)
    assert _elite((large, late, early, early), 2, False) == (early, early)
    assert _elite((large, late, early, early), 2, True) == (early, late)


def finite(fitness, text="y(k-1)"):
    return Individual((parse(text),), (regressor_of(parse(text)),), (1.0,), fitness)


@given(st.lists(st.sampled_from([nan, inf, 1.0, 2.0]), min_size=1, max_size=5), seeds)
def test_a_failure_never_wins_a_tournament_against_a_finite_fitness(values, seed):
    pool = [finite(value) for value in values]
    winner = tournament(pool, 6, stream(seed, Purpose.SELECTION))
    again = stream(seed, Purpose.SELECTION)
    contestants = [again.pick(values) for _ in range(6)]
    assert winner.fitness == min((value for value in contestants if isfinite(value)), default=inf)


def test_a_failure_never_enters_the_hall_of_fame_and_is_last_in_an_elite():
    failures = [finite(value, text) for value, text in ((nan, "y(k-2)"), (inf, "y(k-3)"))]
    good = finite(5.0)
    assert with_entries(HallOfFame(), failures) == HallOfFame()
    assert with_entries(HallOfFame(), [*failures, good]).entries == (good,)
    # A record on which the only structures diverge: nothing enters, and the run goes on.
    setting = replace(
        SMALL, constraints="none", structure="free", primitives=("cube", "exp"), initial_height=4
    )
    island = evolved(1, setting, evaluator=Evaluator(record(), setting))
    assert {each.outcome.verdict.name for each in island.population} >= {"OK", "DIVERGED"}
    assert all(isfinite(entry.fitness) for entry in island.hall.entries)
    assert isfinite(island.elite[0].fitness)


def test_zero_genes_and_constants_are_no_surprise():
    """phi of equal lags is zero; such a gene is left out, and an individual of nothing else is infeasible."""
    zero = parse("phi1(q2(u(k-1)), q2(u(k-1)))")
    evaluator = Evaluator(record(), replace(SMALL, constraints="none"))
    (nothing, something), _ = evaluator.evaluate(
        [(Individual((zero,)), False), (Individual((zero, Constant(3.0), Lagged(0))), False)]
    )
    assert (nothing.outcome.verdict.name, nothing.outcome.reason) == ("INFEASIBLE", "no gene is left")
    assert nothing.genes == (zero,)
    assert something.genes == (Constant(3.0), Lagged(0))
    assert something.key == ("y(k-1)", "1")
