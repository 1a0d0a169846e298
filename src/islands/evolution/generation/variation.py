"""Variation: two crossovers and two mutations (the paper, section 5.1, Figure 1), and random genes.

An individual recombines or mutates, never both. Children of legal parents are legal by construction: no gene
is higher than the limit (such a child keeps its parent's gene), no individual has more genes, phi functions
of a new gene are mended, and where the parameters are constrained every individual has a linear y.
"""

from collections.abc import Sequence

from islands.evolution.gp.gene_structure import LINEAR_OUTPUT, PHI, STRUCTURES, is_linear_output
from islands.evolution.gp.rng import Stream
from islands.evolution.settings import Settings
from islands.model.expression import Apply, Expression, Lagged, Shift, children, height
from islands.model.primitives import PRIMITIVES

Genes = tuple[Expression, ...]

#: Probability that a random tree ends above its height limit, and that a node of it is a back-shift.
_LEAF, _SHIFT = 0.15, 0.4


def random_gene(settings: Settings, inputs: int, draw: Stream, limit: int | None = None) -> Expression:
    """Draw a tree by the grow method: of at most the initial height, functions and back-shifts mixed."""
    limit = settings.initial_height if limit is None else limit
    if limit == 0 or draw.chance(_LEAF):
        return Lagged(draw.randrange(inputs + 1))
    if settings.shifts and (not settings.primitives or draw.chance(_SHIFT)):
        return Shift(draw.choice(settings.shifts), random_gene(settings, inputs, draw, limit - 1))
    primitive = PRIMITIVES[draw.choice(settings.primitives)]
    if settings.structure != "free" and primitive.name in PHI:
        channel = 1 + draw.randrange(inputs)
        arguments = [_lagged_input(settings, channel, draw, limit - 1) for _ in range(primitive.arity)]
    else:
        arguments = [random_gene(settings, inputs, draw, limit - 1) for _ in range(primitive.arity)]
    return Apply(primitive, tuple(arguments))


def _lagged_input(settings: Settings, channel: int, draw: Stream, limit: int) -> Expression:
    leaf: Expression = Lagged(channel)
    while limit > 0 and settings.shifts and not draw.chance(_SHIFT):
        leaf = Shift(draw.choice(settings.shifts), leaf)
        limit -= 1
    return leaf


def random_genes(settings: Settings, inputs: int, draw: Stream) -> Genes:
    """Draw the genes of a first individual."""
    fewest, most = settings.initial_terms
    count = fewest + draw.randrange(most - fewest + 1)
    return legal(tuple(random_gene(settings, inputs, draw) for _ in range(count)), settings)


def low_level_crossover(one: Genes, other: Genes, settings: Settings, draw: Stream) -> tuple[Genes, Genes]:
    """Exchange a subtree between one gene of each parent."""
    i, j = draw.randrange(len(one)), draw.randrange(len(other))
    here, there = _random_path(one[i], draw), _random_path(other[j], draw)
    first = _replaced(one[i], here, _subtree(other[j], there))
    second = _replaced(other[j], there, _subtree(one[i], here))
    return _with_gene(one, i, first, settings), _with_gene(other, j, second, settings)


def high_level_crossover(one: Genes, other: Genes, settings: Settings, draw: Stream) -> tuple[Genes, Genes]:
    """Exchange whole genes behind a cut in each parent, so that lengths vary."""
    i, j = draw.randrange(len(one) + 1), draw.randrange(len(other) + 1)
    first, second = one[:i] + other[j:], other[:j] + one[i:]
    return first[: settings.max_terms] or one, second[: settings.max_terms] or other


def inner_mutation(genes: Genes, settings: Settings, inputs: int, draw: Stream) -> Genes:
    """Replace a subtree of one gene by a random one."""
    position = draw.randrange(len(genes))
    path = _random_path(genes[position], draw)
    return _with_gene(
        genes, position, _replaced(genes[position], path, random_gene(settings, inputs, draw)), settings
    )


def outer_mutation(
    genes: Genes, settings: Settings, inputs: int, draw: Stream, pool: Sequence[Expression]
) -> Genes:
    """Replace one whole gene: by a random one, or by one of the pool's; now and then drop or add one.

    Without a pool it is exactly the paper's: one gene for an entirely new one.
    """
    position = draw.randrange(len(genes))
    if not (pool and draw.chance(settings.from_library)):
        return _with_gene(genes, position, random_gene(settings, inputs, draw), settings)
    fresh = STRUCTURES[settings.structure](draw.choice(pool))
    match draw.randrange(4):
        case 0 if len(genes) > 1:
            return genes[:position] + genes[position + 1 :]
        case 1 if len(genes) < settings.max_terms:
            return (*genes, fresh)
    return (*genes[:position], fresh, *genes[position + 1 :])


def legal(genes: Genes, settings: Settings) -> Genes:
    """Mend genes from elsewhere: phi functions, and a linear y where the constraint needs one."""
    mend = STRUCTURES[settings.structure]
    return with_linear_output(tuple(mend(gene) for gene in genes), settings)


def with_linear_output(genes: Genes, settings: Settings) -> Genes:
    """Give an individual back the linear y that it has lost, where the constraint needs one."""
    if settings.constraints == "none" or any(is_linear_output(gene) for gene in genes):
        return genes
    return (LINEAR_OUTPUT, *genes[: settings.max_terms - 1])


def _with_gene(genes: Genes, position: int, gene: Expression, settings: Settings) -> Genes:
    """Put a gene in its place, mended, or leave the parent's where it is too high."""
    if height(gene) > settings.max_height:
        return genes
    return (*genes[:position], STRUCTURES[settings.structure](gene), *genes[position + 1 :])


_Path = tuple[int, ...]


def _random_path(gene: Expression, draw: Stream) -> _Path:
    """Draw a node, each with the same probability."""
    return draw.choice(_paths(gene))


def _paths(gene: Expression, above: _Path = ()) -> list[_Path]:
    paths = [above]
    for position, child in enumerate(children(gene)):
        paths += _paths(child, (*above, position))
    return paths


def _subtree(gene: Expression, path: _Path) -> Expression:
    for position in path:
        gene = children(gene)[position]
    return gene


def _replaced(gene: Expression, path: _Path, subtree: Expression) -> Expression:
    if not path:
        return subtree
    match gene:
        case Shift(samples, argument):
            return Shift(samples, _replaced(argument, path[1:], subtree))
        case Apply(primitive, arguments):
            here = path[0]
            changed = _replaced(arguments[here], path[1:], subtree)
            return Apply(primitive, (*arguments[:here], changed, *arguments[here + 1 :]))
    return subtree
