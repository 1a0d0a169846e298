"""Tournament selection."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from islands.evolution.rng import Stream

#: Evaluates abandoned individuals, given by their places, completely; returns their fitness.
EvaluateAbandoned = Callable[[NDArray[np.int64]], NDArray[np.float64]]


def run_tournaments(
    fitness: NDArray[np.float64],
    abandoned: NDArray[np.bool_],
    count: int,
    contestants: int,
    rng: Stream,
    abandon_threshold: float,
    evaluate_abandoned: EvaluateAbandoned,
) -> NDArray[np.int64]:
    """Run tournaments among contestants drawn with replacement and return the places of the winners.

    The fittest contestant wins; the first drawn wins a tie.

    Parameters
    ----------
    fitness : ndarray of float64, shape (individuals,)
        Infinite for abandoned individuals and failures.
    abandoned : ndarray of bool, shape (individuals,)
        Individuals whose evaluation was abandoned.
    count : int
        Number of tournaments.
    contestants : int
        Contestants of each tournament.
    abandon_threshold : float
        Lower bound on the fitness of abandoned individuals.
    evaluate_abandoned : callable
        Evaluates abandoned individuals completely. It is called only for those that may win, so the winners
        do not depend on which individuals were abandoned.
    """
    drawn = (rng.draw(count * contestants) * len(fitness)).astype(np.int64).reshape(count, contestants)
    is_open = fitness[drawn].min(axis=1) > abandon_threshold
    undecided = np.unique(drawn[is_open][abandoned[drawn[is_open]]])
    known = fitness.copy()
    known[undecided] = evaluate_abandoned(undecided)
    first = known[drawn].argmin(axis=1, keepdims=True)
    return np.take_along_axis(drawn, first, axis=1)[:, 0]
