"""Tournament selection."""

from collections.abc import Sequence

from islands.evolution.individual import Individual
from islands.evolution.rng import Stream


def tournament(pool: Sequence[Individual], contestants: int, draw: Stream) -> Individual:
    """Draw contestants with replacement and return the fittest; ties go to the one drawn first."""
    best = draw.pick(pool)
    for _ in range(contestants - 1):
        rival = draw.pick(pool)
        if rival.fitness < best.fitness:
            best = rival
    return best
