"""The two crossovers and the two mutations (the paper, section 5.1, Figure 1).

The kernel and the operators on trees breed the same children. The other laws are those of the operators.
"""

from collections import Counter
from dataclasses import replace

import pytest

from islands.evolution.rng import Purpose, Stream
from islands.evolution.settings import Settings
from islands.evolution.variation import random_individuals
from islands.expressions.parsing import parse
from islands.expressions.printing import plain
from islands.expressions.user_primitive import primitive
from support.variation import (
    breed_compiled,
    breed_trees,
    make_index,
    outer_mutation,
    random_genes,
)

SETTINGS = Settings(constraints="none", structure="free", max_terms=6, initial_terms=(1, 6))
SEEDS = range(300)


def stream(seed):
    return Stream(seed, 0, 1, Purpose.VARIATION)


def genes(*texts):
    return tuple(parse(text) for text in texts)


def texts(found):
    return tuple(plain(gene) for gene in found)


LETTERS = genes("y(k-1)", "y(k-2)", "y(k-3)", "y(k-4)")
NUMBERS = genes("u(k-1)", "u(k-2)")


# The kernel.

WIDE = replace(
    SETTINGS,
    crossover=0.6,
    mutation=0.8,
    primitives=("mul", "phi1", "phi2", "tanh", "add"),
    structure="phi",
    constraints="hysteresis",
)

VARIANTS = {
    "paper": WIDE,
    "long genes": replace(WIDE, structure="free", constraints="none", max_height=9, initial_height=7),
    "leaves": replace(WIDE, max_height=0, initial_height=0),
    "no shifts": replace(
        WIDE, structure="free", constraints="none", shifts=(), max_height=2, initial_height=2
    ),
    "no functions": replace(WIDE, structure="increment", primitives=()),
    "increment": replace(WIDE, structure="increment", from_library=0.5, overlong="parent"),
    "one term": replace(WIDE, max_terms=1, initial_terms=(1, 1)),
    "requirements": replace(
        WIDE,
        structure="free",
        constraints="[u1(k-1)] + [u1(k-2)] = 2; [y(k-1)*u2(k-1)] = 1",
        overlong="parent",
    ),
    "user's functions": replace(
        WIDE,
        structure="free",
        constraints="odd",
        primitives=("mul", primitive("bend", lambda a: a / (1 + a * a), parity=-1)),
    ),
}

LIBRARY = genes(
    "u1(k-3)", "y(k-2)*u1(k-1)*u2(k-2)*u1(k-1)", "phi1(u1(k-3), u1(k-1))", "2*u2(k-1)", "q2(y(k-3))"
)


@pytest.mark.parametrize(
    "name", [name if name == "paper" else pytest.param(name, marks=pytest.mark.ci) for name in VARIANTS]
)
def test_kernel_breeds_the_children_of_the_operators_on_trees(name):
    """Each generation has the children of the one before as parents, so that genes get long and repeat."""
    settings, index = VARIANTS[name], make_index(VARIANTS[name])
    for seed in range(4):
        parents = [random_genes(settings, 2, stream(100 + 60 * seed + place)) for place in range(40)]
        for generation in range(5):
            pool = LIBRARY if generation % 2 else ()
            expected = breed_trees(parents, settings, 2, Stream(seed, 0, generation, Purpose.VARIATION), pool)
            compiled = breed_compiled(
                parents, settings, 2, Stream(seed, 0, generation, Purpose.VARIATION), pool, index
            )
            assert compiled == expected
            parents = compiled[::-1]


@pytest.mark.parametrize("name", VARIANTS)
def test_kernel_draws_the_random_genes_of_the_first_population(name):
    settings = VARIANTS[name]
    draws = stream(3), stream(3)
    expected = [random_genes(settings, 2, draws[0]) for _ in range(100)]
    assert random_individuals(100, settings, 2, make_index(settings), draws[1]) == expected


# High-level crossover: whole genes.


# Low-level crossover: subtrees of one gene each.


# Mutations.


def test_outer_mutation_with_a_pool_replaces_drops_or_adds_a_gene():
    always = replace(SETTINGS, from_library=1.0)
    pool = genes("u(k-7)", "u(k-8)")
    kinds = Counter()
    for seed in SEEDS:
        child = outer_mutation(LETTERS, always, 1, stream(seed), pool)
        kinds[len(child) - len(LETTERS)] += 1
        new = [gene for gene in child if gene not in LETTERS]
        assert set(new) <= set(pool)
        assert len(new) == (0 if len(child) < len(LETTERS) else 1)
    # Probabilities: drop 1/4, add 1/4, replace 1/2.
    assert sorted(kinds) == [-1, 0, 1]
    assert kinds[0] == pytest.approx(150, abs=40)
    assert kinds[-1] == pytest.approx(75, abs=32)


def test_outer_mutation_respects_the_limits_of_the_number_of_genes():
    always = replace(SETTINGS, from_library=1.0, max_terms=4, initial_terms=(1, 4))
    for seed in SEEDS:
        assert len(outer_mutation(LETTERS[:1], always, 1, stream(seed), NUMBERS)) in (1, 2)
        assert len(outer_mutation(LETTERS, always, 1, stream(seed), NUMBERS)) in (3, 4)


# Random genes and repair.
