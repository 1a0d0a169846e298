"""Certificate of a model size: a lower bound on the one-step-ahead error of all models of a library.

A search by branch and bound over the inner products of the candidates gives the bound, and the best structure
that it meets. With enough nodes the structure is proved to be the best one. The bound holds up to the
rounding of the inner products: a candidate that depends on others except for rounding counts as one of them.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from itertools import takewhile
from math import sqrt
from threading import Event

import numpy as np
import scipy
from numpy.typing import NDArray

from islands.available_cpus import count_cpus
from islands.estimation.forward_selection import SelectionProblem, Structure
from islands.estimation.structure_selection.froe import froe
from islands.kernels.subset_search import Tree, exchange, search
from islands.rounding import RESOLUTION

#: Largest number of candidates; the time of a node grows with its cube.
MOST_CANDIDATES = 300


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

    def permits(self, error: float) -> bool:
        """Return whether a model of the library can have an error: it is not below the bound."""
        return error >= (1.0 - RESOLUTION) * self.bound

    def proves(self, error: float) -> bool:
        """Return whether no model of the size is better than one with an error."""
        return self.gap(error) <= RESOLUTION


class SubsetSearch:
    """Search for the best subset of the candidates of a problem, for every number of terms.

    Parameters
    ----------
    problem : SelectionProblem
    max_terms : int

    Attributes
    ----------
    structures : tuple of Structure
        The best structure of every number of terms that exchanges of pairs of candidates find; there is none
        if there are more than `MOST_CANDIDATES`.
    """

    def __init__(self, problem: SelectionProblem, max_terms: int) -> None:
        gram, self._energy = problem.gram[:-1, :-1], problem.gram[-1, -1]
        self._problem = problem
        self.structures: tuple[Structure, ...] = ()
        #: Error and positions of the best known subset by number of terms; -1 follows the last position.
        self._exchanged: dict[int, tuple[float, NDArray[np.int64]]] = {}
        usable = np.flatnonzero((np.diag(gram) > 0.0) & np.isfinite(np.diag(gram)))
        if not (len(gram) <= MOST_CANDIDATES and usable.size and 0.0 < self._energy < np.inf):
            return
        norms = np.sqrt(np.diag(gram)[usable])
        scaled = gram[np.ix_(usable, usable)] / norms[:, None] / norms
        correlation = problem.gram[usable, -1] / norms / sqrt(self._energy)
        order, self._tree = _make_tree(scaled)
        self._scaled, self._correlation = scaled[np.ix_(order, order)], correlation[order]
        self._usable = usable[order]
        # A fixed regressor that no candidate can replace is a term of every model.
        replaceable = {item for direction in problem.free for item in direction.regressors}
        self._always = sum(item not in replaceable for item in problem.fixed)
        self._selection = froe(problem.gram, max_terms=max_terms)
        self._exchanged = {
            terms: self._exchange(terms) for terms in range(max(1, self._always), max_terms + 1)
        }
        self.structures = tuple(self._compose(positions) for _, positions in self._exchanged.values())

    def certify(self, nodes: int, skip: Callable[[], bool] = lambda: False) -> tuple[Certificate, ...]:
        """Compute a certificate for every number of terms; the searches run in parallel threads.

        Parameters
        ----------
        nodes : int
            Nodes of the search for each number of terms; fewer are evaluated if the library is large. The
            result depends on it, and not on the time.
        skip : callable
            Called before each number of terms. Once it returns true, the remaining certificates are missing.

        Returns
        -------
        tuple of Certificate
            By number of terms; empty without nodes, or if there are more than `MOST_CANDIDATES`. Their
            structures are those of the exchanges, unless the search finds a better one.
        """
        if not nodes:
            return ()
        skipped = Event()

        def certify_size(terms: int) -> Certificate | None:
            if skipped.is_set() or skip():
                skipped.set()
                return None
            return self._certify(terms, nodes)

        with ThreadPoolExecutor(count_cpus()) as threads:
            found = list(threads.map(certify_size, self._exchanged))
        return tuple(takewhile(lambda each: each is not None, found))  # type: ignore[arg-type]

    def _exchange(self, terms: int) -> tuple[float, NDArray[np.int64]]:
        """Return the error of the best known subset, and its positions."""
        size = terms - self._always
        positions = np.full(max(1, size), -1)
        greedy = self._selection.order[:size]
        positions[: len(greedy)] = [int(np.flatnonzero(self._usable == each)[0]) for each in greedy]
        error = max(0.0, 1.0 - sum(self._selection.err[:size]))
        if len(greedy) == size:
            error = exchange(self._scaled, self._correlation, error, positions[:size])
        return error, positions

    def _certify(self, terms: int, nodes: int) -> Certificate:
        """Search for a better subset than that of the exchanges, and for a bound on the error of all."""
        error, known = self._exchanged[terms]
        positions = known.copy()
        bound, evaluated, size = error, 0, terms - self._always
        if size:
            bound, _, evaluated = search(
                self._scaled, self._correlation, self._tree, size, nodes, error, positions
            )
        error = sqrt(bound * self._energy / self._problem.rows)
        return Certificate(terms, error, evaluated, self._compose(positions))

    def _compose(self, positions: NDArray[np.int64]) -> Structure:
        """Return the structure of some positions."""
        return self._problem.compose([int(self._usable[each]) for each in positions if each >= 0])


def combine_certificates(
    one: tuple[Certificate, ...], other: tuple[Certificate, ...]
) -> tuple[Certificate, ...]:
    """Return certificates that hold for two libraries."""
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
