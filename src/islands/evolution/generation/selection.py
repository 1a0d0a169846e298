"""Tournament selection."""

from collections.abc import Callable, Sequence

from islands.evolution.gp.individual import Individual
from islands.evolution.gp.rng import Stream
from islands.simulation.outcome import Status

#: Tells what is not known of abandoned individuals.
Settle = Callable[[Sequence[Individual]], Sequence[Individual]]


def tournaments(
    pool: Sequence[Individual], count: int, contestants: int, draw: Stream, bar: float, settle: Settle
) -> list[Individual]:
    """Draw contestants with replacement; return the fittest of each tournament, of equals the first drawn.

    Parameters
    ----------
    bar : float
        An abandoned individual is less fit than this.
    settle : callable
        Evaluates abandoned individuals. It is asked for those alone that might win, so every tournament ends
        as if nobody had been abandoned.
    """
    drawn = [[draw.randrange(len(pool)) for _ in range(contestants)] for _ in range(count)]
    fitness = [each.fitness for each in pool]
    abandoned = {place for place, each in enumerate(pool) if each.outcome.verdict is Status.ABANDONED}
    open_ = sorted(
        {
            place
            for places in drawn
            if min(fitness[place] for place in places) > bar
            for place in abandoned.intersection(places)
        }
    )
    for place, settled in zip(open_, settle([pool[place] for place in open_]), strict=True):
        fitness[place] = settled.fitness
    return [pool[min(places, key=fitness.__getitem__)] for places in drawn]
