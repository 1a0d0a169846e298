"""Tournament selection."""

from collections.abc import Callable, Sequence

import numpy as np

from islands.evolution.individual import Individual
from islands.evolution.rng import Stream
from islands.simulation.outcome import Status

#: Evaluates abandoned individuals completely.
EvaluateAbandoned = Callable[[Sequence[Individual]], Sequence[Individual]]


def run_tournaments(
    pool: Sequence[Individual],
    count: int,
    contestants: int,
    rng: Stream,
    abandon_threshold: float,
    evaluate_abandoned: EvaluateAbandoned,
) -> list[Individual]:
    """Run tournaments among contestants drawn with replacement and return the winners.

    The fittest contestant wins; the first drawn wins a tie.

    Parameters
    ----------
    pool : sequence of Individual
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
    drawn = (rng.draw(count * contestants) * len(pool)).astype(np.int64).reshape(count, contestants)
    fitness = np.array([each.fitness for each in pool])
    abandoned = np.array([each.outcome.verdict is Status.ABANDONED for each in pool])
    is_open = fitness[drawn].min(axis=1) > abandon_threshold
    undecided = np.unique(drawn[is_open][abandoned[drawn[is_open]]]).tolist()
    evaluated = evaluate_abandoned([pool[place] for place in undecided])
    fitness[undecided] = [each.fitness for each in evaluated]
    first = fitness[drawn].argmin(axis=1)
    return [pool[place] for place in drawn[np.arange(count), first].tolist()]
