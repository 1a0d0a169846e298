"""Selection of state spaces: the elite of an island, and the parents of offspring."""

from collections.abc import Iterable, Sequence
from math import log

from numpy.random import Generator

from islands.estimation.fitted_state_space import FittedStateSpace
from islands.estimation.latent_models import find_front
from islands.evolution.individual import unique_structures

#: Least error in the criterion: of a record without noise it has no limit.
_LEAST_FITNESS = 1e-300

#: Probability that a parent is drawn from the front of size and error.
_FROM_FRONT = 0.3


def select_latent_elite(
    systems: Iterable[FittedStateSpace], count: int, rows: int
) -> tuple[FittedStateSpace, ...]:
    """Return the systems of the least criterion, each structure once, with the front of size and error.

    Parameters
    ----------
    systems : iterable of FittedStateSpace
    count : int
    rows : int
        Samples of the criterion.

    Returns
    -------
    tuple of FittedStateSpace
        Least criterion first. It is the logarithm of the error with the penalty of the number of parameters
        of the Bayesian information criterion (Schwarz, Annals of Statistics 6 (1978) 461-464): without it,
        systems grow.
    """

    def order(system: FittedStateSpace) -> tuple[float, int, tuple[str, ...]]:
        criterion = log(max(system.fitness, _LEAST_FITNESS)) + system.size * log(rows) / rows
        return criterion, system.size, system.key

    ordered = unique_structures(sorted(systems, key=order))
    front = find_front(ordered)[-count:]
    keys = {each.key for each in front}
    others = [each for each in ordered if each.key not in keys][: count - len(front)]
    return tuple(sorted((*front, *others), key=order))


def select_parent(elite: Sequence[FittedStateSpace], contestants: int, rng: Generator) -> FittedStateSpace:
    """Return a system of the front, or the best one of a tournament."""
    if rng.random() < _FROM_FRONT:
        front = find_front(elite)
        return front[int(rng.integers(len(front)))]
    return elite[int(rng.integers(len(elite), size=contestants).min())]
