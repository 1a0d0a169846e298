"""Memory of an identification: an estimate from its settings, and the limits that it must keep."""

import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from islands.errors import IslandsError, SettingsError
from islands.evolution.settings import Settings

#: Bytes of an individual in the actor of its island and in the coordinator, measured with the preset
#: hysteresis. The caches of an actor take up to 0.3 GB in addition.
ACTOR_BYTES, COORDINATOR_BYTES = 7_400, 4_000

#: Fraction of the memory of this machine that one job may take by default.
DEFAULT_SHARE = 0.5

#: File with the memory limit of a container.
_CONTAINER_LIMIT = Path("/sys/fs/cgroup/memory.max")


class JobMemoryError(IslandsError):
    """A job needs more memory than the cluster or the coordinator has."""


@dataclass(frozen=True, slots=True)
class JobMemory:
    """Estimated memory of the individuals of a search.

    Attributes
    ----------
    population, islands : int
    """

    population: int
    islands: int

    @property
    def actor_bytes(self) -> int:
        """Bytes in all actors."""
        return self.population * self.islands * ACTOR_BYTES

    @property
    def coordinator_bytes(self) -> int:
        """Bytes in the coordinator."""
        return self.population * self.islands * COORDINATOR_BYTES

    @property
    def total_bytes(self) -> int:
        """Bytes in all processes."""
        return self.actor_bytes + self.coordinator_bytes

    def check_limit(self, limit: int) -> None:
        """Check the limit of a service for one job.

        Raises
        ------
        SettingsError
        """
        if self.total_bytes > limit:
            raise SettingsError(
                f"{self} need about {_format(self.total_bytes)} of memory, and a job on this service may "
                f"take {_format(limit)}: take fewer islands or a smaller population, at most "
                f"{limit // (ACTOR_BYTES + COORDINATOR_BYTES)} individuals in all"
            )

    def check_available(self, cluster: float, coordinator: float) -> None:
        """Check the memory of the cluster and of the machine of the coordinator, both in bytes.

        Raises
        ------
        JobMemoryError
        """
        for needed, available, place in (
            (self.actor_bytes, cluster, "actors, and the cluster"),
            (self.coordinator_bytes, coordinator, "the coordinator, whose machine"),
        ):
            if needed > available:
                raise JobMemoryError(
                    f"{self} need about {_format(needed)} of memory in {place} has "
                    f"{_format(available)}: take fewer islands or a smaller population, or add memory and "
                    "resume the job"
                )

    def __str__(self) -> str:
        return f"{self.islands} islands of {self.population} individuals"


def estimate_memory(alternatives: Iterable[Settings]) -> JobMemory:
    """Estimate the memory of a search, the largest if its settings are one of several alternatives."""
    memories = [JobMemory(settings.population, settings.islands) for settings in alternatives]
    return max(memories, key=lambda memory: memory.total_bytes)


def machine_memory() -> int:
    """Return the memory of this machine, or of the container of this process, in bytes."""
    found = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    # The file contains "max" if the container has no limit.
    with suppress(OSError, ValueError):
        found = min(found, int(_CONTAINER_LIMIT.read_text()))
    return found


def _format(count: float) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e9 else f"{count / 1e6:.3g} MB"
