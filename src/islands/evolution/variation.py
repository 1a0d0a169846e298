"""Variation: two crossovers and two mutations (the paper, section 5.1, Figure 1), and random genes.

An individual recombines or mutates, never both. Children of valid parents are valid by construction: genes
above the height limit are replaced by the parent's gene, the number of genes is limited, phi functions of new
genes are repaired, and individuals under a parameter constraint have a linear output gene.
"""

from collections.abc import Sequence

from islands.estimation.parameter_constraints import constraint
from islands.evolution.gene_structure import LINEAR_OUTPUT, PHI, STRUCTURES, is_linear_output, with_phi
from islands.evolution.individual import make_regressor
from islands.evolution.rng import Stream
from islands.evolution.settings import Settings
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Apply, Expression, Lagged, Primitive, Shift, children, height

Genes = tuple[Expression, ...]

#: Probability that a random tree ends in a leaf before its height limit.
_LEAF_PROBABILITY = 0.15

#: Probability that an inner node of a random tree is a back-shift.
_SHIFT_PROBABILITY = 0.4


def random_gene(settings: Settings, inputs: int, rng: Stream, limit: int | None = None) -> Expression:
    """Draw a tree of functions and back-shifts by the grow method, up to a limit or the initial height."""
    limit = settings.initial_height if limit is None else limit
    if limit == 0 or rng.chance(_LEAF_PROBABILITY):
        return Lagged(rng.randrange(inputs + 1))
    if settings.shifts and (not settings.primitives or rng.chance(_SHIFT_PROBABILITY)):
        return Shift(rng.choice(settings.shifts), random_gene(settings, inputs, rng, limit - 1))
    entry = rng.choice(settings.primitives)
    primitive = entry if isinstance(entry, Primitive) else PRIMITIVES[entry]
    if settings.structure != "free" and primitive.name in PHI:
        channel = 1 + rng.randrange(inputs)
        arguments = [_lagged_input(settings, channel, rng, limit - 1) for _ in range(primitive.arity)]
    else:
        arguments = [random_gene(settings, inputs, rng, limit - 1) for _ in range(primitive.arity)]
    return Apply(primitive, tuple(arguments))


def _lagged_input(settings: Settings, channel: int, rng: Stream, limit: int) -> Expression:
    leaf: Expression = Lagged(channel)
    while limit > 0 and settings.shifts and not rng.chance(_SHIFT_PROBABILITY):
        leaf = Shift(rng.choice(settings.shifts), leaf)
        limit -= 1
    return leaf


def random_genes(settings: Settings, inputs: int, rng: Stream) -> Genes:
    """Draw the genes of an individual of the first population."""
    fewest, most = settings.initial_terms
    count = fewest + rng.randrange(most - fewest + 1)
    return repair_genes(tuple(random_gene(settings, inputs, rng) for _ in range(count)), settings)


def low_level_crossover(one: Genes, other: Genes, settings: Settings, rng: Stream) -> tuple[Genes, Genes]:
    """Exchange a subtree between one gene of each parent."""
    i, j = rng.randrange(len(one)), rng.randrange(len(other))
    here, there = _random_path(one[i], rng), _random_path(other[j], rng)
    first = _replace_subtree(one[i], here, _get_subtree(other[j], there))
    second = _replace_subtree(other[j], there, _get_subtree(one[i], here))
    return _with_gene(one, i, first, settings), _with_gene(other, j, second, settings)


def high_level_crossover(one: Genes, other: Genes, settings: Settings, rng: Stream) -> tuple[Genes, Genes]:
    """Exchange the genes after a cut point in each parent; the number of genes may change.

    Children with too many genes are truncated, or replaced by a parent.
    """
    i, j = rng.randrange(len(one) + 1), rng.randrange(len(other) + 1)
    first, second = one[:i] + other[j:], other[:j] + one[i:]
    if settings.overlong == "parent":
        first, second = (
            child if len(child) <= settings.max_terms else parent
            for child, parent in ((first, one), (second, other))
        )
    return first[: settings.max_terms] or one, second[: settings.max_terms] or other


def inner_mutation(genes: Genes, settings: Settings, inputs: int, rng: Stream) -> Genes:
    """Replace a subtree of one gene by a random tree."""
    position = rng.randrange(len(genes))
    path = _random_path(genes[position], rng)
    return _with_gene(
        genes, position, _replace_subtree(genes[position], path, random_gene(settings, inputs, rng)), settings
    )


def outer_mutation(
    genes: Genes, settings: Settings, inputs: int, rng: Stream, pool: Sequence[Expression]
) -> Genes:
    """Replace one gene by a random gene, or replace, remove or add a gene using the pool.

    Without a pool this is the outer mutation of the paper: a random gene replaces one gene.
    """
    position = rng.randrange(len(genes))
    if not (pool and rng.chance(settings.from_library)):
        return _with_gene(genes, position, random_gene(settings, inputs, rng), settings)
    gene = STRUCTURES[settings.structure](rng.choice(pool))
    match rng.randrange(4):
        case 0 if len(genes) > 1:
            return genes[:position] + genes[position + 1 :]
        case 1 if len(genes) < settings.max_terms:
            return (*genes, gene)
    return (*genes[:position], gene, *genes[position + 1 :])


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


def _with_gene(genes: Genes, position: int, gene: Expression, settings: Settings) -> Genes:
    """Replace a gene by a repaired new one; keep the parent's gene if the new one is too high."""
    if height(gene) > settings.max_height:
        return genes
    return (*genes[:position], STRUCTURES[settings.structure](gene), *genes[position + 1 :])


_Path = tuple[int, ...]


def _random_path(gene: Expression, rng: Stream) -> _Path:
    """Draw a node uniformly and return its path from the root."""
    return rng.choice(_list_paths(gene))


def _list_paths(gene: Expression, above: _Path = ()) -> list[_Path]:
    paths = [above]
    for position, child in enumerate(children(gene)):
        paths += _list_paths(child, (*above, position))
    return paths


def _get_subtree(gene: Expression, path: _Path) -> Expression:
    for position in path:
        gene = children(gene)[position]
    return gene


def _replace_subtree(gene: Expression, path: _Path, subtree: Expression) -> Expression:
    if not path:
        return subtree
    match gene:
        case Shift(samples, argument):
            return Shift(samples, _replace_subtree(argument, path[1:], subtree))
        case Apply(primitive, arguments):
            here = path[0]
            changed = _replace_subtree(arguments[here], path[1:], subtree)
            return Apply(primitive, (*arguments[:here], changed, *arguments[here + 1 :]))
    return subtree
