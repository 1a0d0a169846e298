"""Variation: two crossovers and two mutations (the paper, section 5.1, Figure 1), and random genes.

An individual recombines or mutates, never both. Children of valid parents are valid by construction: genes
above the height limit are replaced by the parent's gene, the number of genes is limited, phi functions of new
genes are repaired, and individuals under a parameter constraint have a linear output gene. The operators are
in `islands.kernels.breeding`.
"""

from collections.abc import Sequence

import numpy as np

from islands.estimation.parameter_constraints import constraint
from islands.evolution.gene_index import GeneIndex
from islands.evolution.gene_structure import LINEAR_OUTPUT, PHI, STRUCTURES, is_linear_output, with_phi
from islands.evolution.individual import make_regressor
from islands.evolution.rng import Stream
from islands.evolution.settings import Settings
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Expression, Lagged, Primitive
from islands.kernels import breeding
from islands.kernels.breeding import UNUSED, Draws, Individuals, Variation, empty_individuals

Genes = tuple[Expression, ...]

#: Random numbers that are drawn for each individual of a generation at first.
_DRAWS = 16


def random_individuals(
    count: int, settings: Settings, inputs: int, index: GeneIndex, rng: Stream
) -> list[Genes]:
    """Draw the genes of individuals of the first population."""
    found = empty_individuals(count, settings.max_terms)
    _breed(empty_individuals(0, 0), found, make_variation(settings, inputs, index), index, rng)
    rows = zip(*(array.tolist() for array in found), strict=True)
    drawn = [tuple([index.genes[number] for number in genes[:length]]) for genes, length in rows]
    return [repair_genes(genes, settings) for genes in drawn]


def breed(
    parents: Individuals,
    settings: Settings,
    inputs: int,
    index: GeneIndex,
    rng: Stream,
    pool: Sequence[Expression] = (),
) -> Individuals:
    """Recombine each pair of parents, or mutate each of the two, with the probabilities of the settings.

    Parameters
    ----------
    parents : Individuals
        An even number, with room for the largest number of genes.
    settings : Settings
    inputs : int
    index : GeneIndex
        New genes are added.
    rng : Stream
    pool : sequence of Expression
        Genes that an outer mutation may take whole. Without a pool the outer mutation is that of the paper: a
        random gene replaces one gene.
    """
    children = empty_individuals(*parents.genes.shape)
    _breed(parents, children, make_variation(settings, inputs, index, pool), index, rng)
    after = np.arange(children.genes.shape[1]) >= children.lengths[:, None]
    children.genes[after] = UNUSED
    return children


def _breed(
    parents: Individuals, children: Individuals, variation: Variation, index: GeneIndex, rng: Stream
) -> None:
    """Call the kernel until it is complete; before the next call, provide what was missing."""
    done, position = np.zeros(1, np.int64), np.zeros(1, np.int64)
    numbers = rng.draw(_DRAWS * len(children.lengths))
    while status := breeding.breed(parents, children, done, variation, index.table, Draws(numbers, position)):
        if status == breeding.NUMBERS_USED:
            numbers = np.append(numbers, rng.draw(numbers.size))
        elif status == breeding.TABLE_FULL:
            index.grow()
        index.complete()
    index.complete()


def make_variation(
    settings: Settings, inputs: int, index: GeneIndex, pool: Sequence[Expression] = ()
) -> Variation:
    """Return the settings of variation in the layout of the kernels."""
    entries = [entry if isinstance(entry, Primitive) else PRIMITIVES[entry] for entry in settings.primitives]
    lagged = [settings.structure != "free" and entry.name in PHI for entry in entries]
    required, leads = index.required_genes()
    library = index.repair(pool)

    def number(symbols: list[int]) -> np.ndarray:
        return np.array(symbols, np.int64)

    return Variation(
        float(settings.crossover),
        float(settings.high_level),
        float(settings.mutation),
        float(settings.outer),
        float(settings.from_library),
        settings.max_terms,
        settings.max_height,
        settings.initial_height,
        *settings.initial_terms,
        settings.overlong == "truncate",
        number([index.symbol(Lagged(channel), 0) for channel in range(max(inputs, 1) + 1)]),
        number([index.symbol(samples, 1) for samples in settings.shifts]),
        number([index.symbol((entry, entry.arity), entry.arity) for entry in entries]),
        np.array(lagged, np.bool_),
        inputs,
        number(required),
        np.array(leads, np.bool_),
        number(library),
    )


def repair_genes(genes: Genes, settings: Settings) -> Genes:
    """Repair genes from outside the search: phi functions, and a linear output gene if required."""
    repair = STRUCTURES[settings.structure]
    return with_required_genes(tuple(repair(gene) for gene in genes), settings)


def with_required_genes(genes: Genes, settings: Settings) -> Genes:
    """Add the genes that the parameter constraint needs: the linear output, and terms of its equalities."""
    constrained = constraint(settings.constraints)
    if constrained.sums and not any(is_linear_output(gene) for gene in genes):
        genes = (LINEAR_OUTPUT, *genes[: settings.max_terms - 1])
    for terms in constrained.required:
        if not any(make_regressor(gene) in terms for gene in genes):
            genes = (*genes[: settings.max_terms - 1], with_phi(terms[0].expression))
    return genes
