"""Deadlines of epochs: an actor that computes for longer than the measured epochs suggest counts as frozen.

The deadlines are independent of actors and Ray. The time that a task waits in the queue of its actor, or for
emigrants of other islands, does not count.
"""

from collections import deque
from collections.abc import Hashable, Mapping
from typing import TypeVar

from islands_service.runtime.epoch_scheduler import EpochTask

#: Identity of an actor.
A = TypeVar("A", bound=Hashable)

#: Multiple of the slowest recent epoch that an epoch may take.
FACTOR = 2.0

#: Seconds that an epoch may take in addition, for example while the machine swaps.
ALLOWANCE = 2.0

#: Multiple of the slowest first population that the others may take, and seconds in addition.
FIRST_FACTOR, FIRST_ALLOWANCE = 10.0, 30.0

#: Seconds per individual, and in all, that an epoch may take before any is measured.
UNMEASURED_PER_INDIVIDUAL, UNMEASURED_ALLOWANCE = 0.05, 60.0

#: Epochs per island from which the slowest is taken.
_RECENT = 4

#: Longest time between two checks that counts, in seconds. The process may have been suspended, or has
#: written a large checkpoint, and the answers of this time are not collected yet.
_LONGEST_STEP = 1.0

#: Largest multiple of a deadline after losses.
_MAX_PATIENCE = 64.0


class EpochDeadlines:
    """Measured durations of epochs, and the time for which each actor has computed its present one.

    Parameters
    ----------
    islands : int
    population : int
        Individuals of an island.
    """

    def __init__(self, islands: int, population: int) -> None:
        self._population = population
        # Seconds per generation, and seconds of the first populations.
        self._rates: deque[float] = deque(maxlen=_RECENT * islands)
        self._first: deque[float] = deque(maxlen=islands)
        self._patience = 1.0
        self._computing: dict[Hashable, tuple[EpochTask, float]] = {}
        self._checked_at: float | None = None

    def record(self, task: EpochTask, seconds: float) -> None:
        """Record the duration of a completed epoch.

        Parameters
        ----------
        seconds : float
            Duration measured by the actor, without the time in its queue.
        """
        if task.begin < 0:
            self._first.append(seconds)
        else:
            self._rates.append(seconds / (task.end - task.begin))

    def extend(self) -> None:
        """Double all deadlines after a loss: caches are empty, and the machine may be overloaded."""
        self._patience = min(2.0 * self._patience, _MAX_PATIENCE)

    def reset(self) -> None:
        """Undo the extension, since an epoch of all islands was completed and measured in spite of losses."""
        self._patience = 1.0

    def seconds_allowed(self, task: EpochTask) -> float:
        """Return the time in seconds that an actor has for a task."""
        generations = task.end - task.begin
        if task.begin >= 0 and self._rates:
            seconds = FACTOR * max(self._rates) * generations + ALLOWANCE
        elif self._first:
            seconds = FIRST_FACTOR * max(self._first) * generations + FIRST_ALLOWANCE
        else:
            seconds = UNMEASURED_PER_INDIVIDUAL * self._population * generations + UNMEASURED_ALLOWANCE
        return self._patience * seconds

    def find_frozen(self, now: float, computing: Mapping[A, EpochTask]) -> list[A]:
        """Return the actors whose deadline has passed.

        Parameters
        ----------
        now : float
            Seconds of a monotonic clock.
        computing : mapping
            The task that each actor must be computing: the first in its queue, if its dependencies are known.
            Every call must have been preceded by the collection of all results.
        """
        step = 0.0 if self._checked_at is None else min(now - self._checked_at, _LONGEST_STEP)
        self._checked_at = now
        current: dict[Hashable, tuple[EpochTask, float]] = {}
        for actor, task in computing.items():
            before, seconds = self._computing.get(actor, (None, 0.0))
            current[actor] = task, seconds + step if before is task else 0.0
        self._computing = current
        return [actor for actor, task in computing.items() if current[actor][1] > self.seconds_allowed(task)]
