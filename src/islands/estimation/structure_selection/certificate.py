"""Certificate of a model size: a lower bound on the one-step-ahead error of all models of a library.

A search by branch and bound over the inner products of the candidates gives the bound, and the best structure
that it meets. With enough nodes the structure is proved to be the best one. The bound holds up to the
rounding of the inner products: a candidate that depends on others except for rounding counts as one of them.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import sqrt

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.estimation.forward_selection import SelectionProblem, Structure
from islands.estimation.structure_selection.froe import froe
from islands.kernels.subset_search import Tree, exchange, search

#: Largest number of candidates; the time of a node grows with its cube.
MOST_CANDIDATES = 300

#: Relative difference of errors that is rounding.
ROUNDING = 1e-6


@dataclass(frozen=True, slots=True)
class Certificate:
    """Lower bound on the error of all models of a library with a number of terms.

    Attributes
    ----------
    terms : int
        Number of terms.
    bound : float
        No model has a smaller root mean square of the one-step-ahead residual, in the unit of the output.
    nodes : int
        Nodes of the search.
    structure : tuple of Regressor
        Best structure that the search met. Under a constraint it may have more terms.
    """

    terms: int
    bound: float
    nodes: int
    structure: Structure

    def gap(self, error: float) -> float:
        """Return the fraction by which another model of the size could be better than one with an error."""
        return max(0.0, 1.0 - self.bound / error) if error > 0.0 else 0.0

    def proves(self, error: float) -> bool:
        """Return whether no model of the size is better than one with an error."""
        return self.gap(error) <= ROUNDING


def certify(
    problem: SelectionProblem, max_terms: int, nodes: int, skip: Callable[[], bool] = lambda: False
) -> tuple[Certificate, ...]:
    """Compute a certificate for every number of terms up to a maximum.

    Parameters
    ----------
    problem : SelectionProblem
    max_terms : int
    nodes : int
        Nodes of the search for each number of terms; fewer are evaluated if the library is large. The result
        depends on it, and not on the time.
    skip : callable
        Called before each number of terms. Once it returns true, the remaining certificates are missing.

    Returns
    -------
    tuple of Certificate
        By number of terms; empty without nodes, or if there are more than `MOST_CANDIDATES`.
    """
    gram, energy = problem.gram[:-1, :-1], problem.gram[-1, -1]
    usable = np.flatnonzero((np.diag(gram) > 0.0) & np.isfinite(np.diag(gram)))
    if not nodes or len(gram) > MOST_CANDIDATES or not (usable.size and 0.0 < energy < np.inf):
        return ()
    norms = np.sqrt(np.diag(gram)[usable])
    scaled = gram[np.ix_(usable, usable)] / norms[:, None] / norms
    correlation = problem.gram[usable, -1] / norms / sqrt(energy)
    order, tree = _make_tree(scaled)
    scaled, correlation, usable = scaled[np.ix_(order, order)], correlation[order], usable[order]
    # A fixed regressor that no candidate can replace is a term of every model.
    replaceable = {item for direction in problem.free for item in direction.regressors}
    always = sum(item not in replaceable for item in problem.fixed)
    selection = froe(problem.gram, max_terms=max_terms)
    certificates = []
    for terms in range(max(1, always), max_terms + 1):
        if skip():
            break
        size = terms - always
        positions = np.full(max(1, size), -1)
        greedy = selection.order[:size]
        positions[: len(greedy)] = [int(np.flatnonzero(usable == each)[0]) for each in greedy]
        error = max(0.0, 1.0 - sum(selection.err[:size]))
        bound, evaluated = error, 0
        if len(greedy) == size:
            error = exchange(scaled, correlation, error, positions[:size])
        if size:
            bound, _, evaluated = search(scaled, correlation, tree, size, nodes, error, positions)
        structure = problem.compose([int(usable[each]) for each in positions if each >= 0])
        certificates.append(Certificate(terms, sqrt(bound * energy / problem.rows), evaluated, structure))
    return tuple(certificates)


def combine_certificates(
    one: tuple[Certificate, ...] | None, other: tuple[Certificate, ...]
) -> tuple[Certificate, ...]:
    """Return certificates that hold for two libraries; those of the second if there is no first one."""
    if one is None:
        return other
    return tuple(
        replace(min(first, second, key=lambda each: each.bound), nodes=first.nodes + second.nodes)
        for first, second in zip(one, other, strict=False)
    )


def _make_tree(gram: NDArray[np.float64]) -> tuple[NDArray[np.int64], Tree]:
    """Return an order of columns of norm 1 and the tree over it that joins the most correlated ones first."""
    count = len(gram)
    size = 2 * count - 1
    width, left, right = np.ones(size, np.int64), np.full(size, -1), np.full(size, -1)
    if count > 1:
        distances = np.sqrt(np.maximum(0.0, 1.0 - gram**2))
        pairs = scipy.spatial.distance.squareform(distances, checks=False)
        # A module of SciPy is loaded at its first use: this one takes a tenth of a second.
        for node, (one, other, *_) in enumerate(scipy.cluster.hierarchy.average(pairs), start=count):
            left[node], right[node] = int(one), int(other)
            width[node] = width[left[node]] + width[right[node]]
    first = np.zeros(size, np.int64)
    for node in range(size - 1, count - 1, -1):
        first[left[node]] = first[node]
        first[right[node]] = first[node] + width[left[node]]
    order = np.empty(count, np.int64)
    order[first[:count]] = np.arange(count)
    return order, Tree(first, first + width, left, right)
