"""Variation on trees, as the paper describes it (section 5.1, Figure 1): the reference of the kernel."""

from functools import partial

from islands.estimation.parameter_constraints import constraint
from islands.evolution.gene_index import GeneIndex
from islands.evolution.gene_structure import PHI, STRUCTURES
from islands.evolution.individual import make_regressor
from islands.evolution.variation import breed, repair_genes, with_required_genes
from islands.expressions.primitives import PRIMITIVES
from islands.expressions.tree import Apply, Lagged, Primitive, Shift, children, height

#: Probability that a random tree ends in a leaf before its height limit.
_LEAF_PROBABILITY = 0.15

#: Probability that an inner node of a random tree is a back-shift.
_SHIFT_PROBABILITY = 0.4


def random_gene(settings, inputs, rng, limit=None):
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


def _lagged_input(settings, channel, rng, limit):
    leaf = Lagged(channel)
    while limit > 0 and settings.shifts and not rng.chance(_SHIFT_PROBABILITY):
        leaf = Shift(rng.choice(settings.shifts), leaf)
        limit -= 1
    return leaf


def random_genes(settings, inputs, rng):
    """Draw the genes of an individual of the first population."""
    fewest, most = settings.initial_terms
    count = fewest + rng.randrange(most - fewest + 1)
    return repair_genes(tuple(random_gene(settings, inputs, rng) for _ in range(count)), settings)


def low_level_crossover(one, other, settings, rng):
    """Exchange a subtree between one gene of each parent."""
    i, j = rng.randrange(len(one)), rng.randrange(len(other))
    here, there = _random_path(one[i], rng), _random_path(other[j], rng)
    first = _replace_subtree(one[i], here, _get_subtree(other[j], there))
    second = _replace_subtree(other[j], there, _get_subtree(one[i], here))
    return _with_gene(one, i, first, settings), _with_gene(other, j, second, settings)


def high_level_crossover(one, other, settings, rng):
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


def inner_mutation(genes, settings, inputs, rng):
    """Replace a subtree of one gene by a random tree."""
    position = rng.randrange(len(genes))
    path = _random_path(genes[position], rng)
    return _with_gene(
        genes, position, _replace_subtree(genes[position], path, random_gene(settings, inputs, rng)), settings
    )


def outer_mutation(genes, settings, inputs, rng, pool):
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


def _with_gene(genes, position, gene, settings):
    """Replace a gene by a repaired new one; keep the parent's gene if the new one is too high."""
    if height(gene) > settings.max_height:
        return genes
    return (*genes[:position], STRUCTURES[settings.structure](gene), *genes[position + 1 :])


def _random_path(gene, rng):
    """Draw a node uniformly and return its path from the root."""
    return rng.choice(_list_paths(gene))


def _list_paths(gene, above=()):
    paths = [above]
    for position, child in enumerate(children(gene)):
        paths += _list_paths(child, (*above, position))
    return paths


def _get_subtree(gene, path):
    for position in path:
        gene = children(gene)[position]
    return gene


def _replace_subtree(gene, path, subtree):
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


def breed_trees(parents, settings, inputs, rng, pool=()):
    """Return the children of all couples."""
    offspring = []
    for place in range(0, len(parents), 2):
        offspring += _breed_pair(parents[place : place + 2], settings, inputs, rng, pool)
    return offspring


def breed_compiled(parents, settings, inputs, rng, pool=(), index=None):
    """Return the children of all couples that the kernel breeds."""
    index = index or make_index(settings)
    couples = index.number_genes(parents, settings.max_terms)
    return list_genes(breed(couples, settings, inputs, index, rng, pool), index)


def make_index(settings):
    """Return an empty index of genes."""
    targets = Lagged(0, 0), Lagged(0, 1)
    return GeneIndex(constraint(settings.constraints), targets, structure=STRUCTURES[settings.structure])


def list_genes(individuals, index):
    """Return the genes of individuals as trees."""
    rows = zip(*(array.tolist() for array in individuals), strict=True)
    return [tuple(index.genes[number] for number in row[:length]) for row, length in rows]


def _breed_pair(parents, settings, inputs, rng, pool):
    """Recombine two parents, or mutate each with the given probability."""
    if rng.chance(settings.crossover):
        one, other = parents
        cross = high_level_crossover if rng.chance(settings.high_level) else low_level_crossover
        return _breed_new(partial(cross, one, other, settings, rng), parents, settings)
    offspring = []
    for genes in parents:
        if not rng.chance(settings.mutation):
            offspring.append(with_required_genes(genes, settings))
            continue
        mutate = partial(_mutate, genes, settings, inputs, rng, pool, rng.chance(settings.outer))
        offspring += _breed_new(mutate, [genes], settings)
    return offspring


def _mutate(genes, settings, inputs, rng, pool, outer):
    if outer:
        return (outer_mutation(genes, settings, inputs, rng, pool),)
    return (inner_mutation(genes, settings, inputs, rng),)


def _breed_new(breed_once, parents, settings):
    """Breed until there are children with new structures, at most five times."""
    known = {find_structure(genes, settings) for genes in parents}
    new = []
    for _ in range(5):
        bred = [with_required_genes(genes, settings) for genes in breed_once()]
        new += [genes for genes in bred if find_structure(genes, settings) not in known]
        if len(new) >= len(bred):
            break
    return [*new, *bred][: len(bred)]


def find_structure(genes, settings):
    """Return the regressors of genes; None for genes that are zero or not admitted by the constraint."""
    admits = constraint(settings.constraints).admits
    regressors = map(make_regressor, genes)
    return frozenset(item if item is not None and admits(item) else None for item in regressors)
