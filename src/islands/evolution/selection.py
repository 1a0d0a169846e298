"""Tournament selection."""

from collections.abc import Callable, Sequence

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
    drawn = [[rng.randrange(len(pool)) for _ in range(contestants)] for _ in range(count)]
    fitness = [each.fitness for each in pool]
    abandoned = {place for place, each in enumerate(pool) if each.outcome.verdict is Status.ABANDONED}
    undecided = sorted(
        {
            place
            for places in drawn
            if min(fitness[place] for place in places) > abandon_threshold
            for place in abandoned.intersection(places)
        }
    )
    evaluated = evaluate_abandoned([pool[place] for place in undecided])
    for place, each in zip(undecided, evaluated, strict=True):
        fitness[place] = each.fitness
    return [pool[min(places, key=fitness.__getitem__)] for places in drawn]
