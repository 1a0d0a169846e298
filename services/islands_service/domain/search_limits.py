"""Limits of searches: the settings of jobs from untrusted clients, and the memory that a job takes."""

import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from islands.errors import IslandsError, SettingsError
from islands.estimation.parameter_constraints import constraint
from islands.estimation.structure_selection.input_delays import expand_delays
from islands.evolution.presets import AUTO, resolve_coupled_settings, resolve_kinds, resolve_settings
from islands.evolution.settings import Settings
from islands.models.candidate_library import candidates, count_inputs
from islands_service.domain.job_spec import Identification

#: Largest values over REST of settings that would otherwise cost memory rather than time.
LIMITS = {
    "population": 100_000,
    "generations": 1_000_000,
    "max_terms": 100,
    "max_height": 12,
    "library_degree": 8,
    "library_lags": 30,
    "initial_height": 12,
    "tournament": 10_000,
    "shooting": 10**9,
    "max_evaluations": 10**15,
}

#: Largest number of entries of a list.
_MAX_ENTRIES = 64

#: Largest back-shift, in samples.
MAX_SHIFT = 1000

#: Largest number of characters of a text.
_MAX_TEXT = 20_000

#: Bytes of an individual in the actor of its island and in the coordinator, measured with the preset
#: hysteresis. The caches of an actor take up to 0.3 GB in addition.
ACTOR_BYTES, COORDINATOR_BYTES = 7_400, 4_000

#: Fraction of the memory of this machine that one job may take by default.
DEFAULT_SHARE = 0.5

#: File with the memory limit of a container.
_CONTAINER_LIMIT = Path("/sys/fs/cgroup/memory.max")


def resolve_job_settings(
    spec: Identification, max_islands: int, max_evaluations: int
) -> tuple[Settings, ...]:
    """Return the search settings of a job from an untrusted client; those of every kind for the preset auto.

    Raises
    ------
    SettingsError
        A setting is unknown or out of range, or exceeds a limit of this service.
    """
    changes = spec.changes
    for name, most in {**LIMITS, "islands": max_islands}.items():
        # Check before building anything: a million islands would exhaust the memory of this process.
        if changes.get(name, 0) > most:
            raise SettingsError(f"{name} is at most {most} on this service, got {changes[name]}")
    for name, value in changes.items():
        if isinstance(value, str) and len(value) > _MAX_TEXT:
            raise SettingsError(f"{name} has {len(value)} characters, and {_MAX_TEXT} is the most")
        if isinstance(value, tuple) and len(value) > _MAX_ENTRIES:
            raise SettingsError(f"{name} has {len(value)} entries, and {_MAX_ENTRIES} is the most")
    if any(shift > MAX_SHIFT for shift in changes.get("shifts", ())):
        raise SettingsError(f"back-shifts are at most {MAX_SHIFT} on this service, got {changes['shifts']}")
    if len(spec.outputs) > 1:
        resolved: tuple[Settings, ...] = (resolve_coupled_settings(spec.preset, changes),)
        # One search for each output.
        max_evaluations //= len(spec.outputs)
    elif spec.preset == AUTO:
        resolved = tuple(resolve_kinds(changes).values())
    else:
        resolved = (resolve_settings(spec.preset, changes),)
    inputs, _ = spec.columns
    for settings in resolved:
        _check_settings(settings, len(inputs), max_evaluations)
    return resolved


def _check_settings(settings: Settings, inputs: int, max_evaluations: int) -> None:
    constraint(settings.constraints).check_inputs(inputs)
    expand_delays(settings.library_delays, inputs)
    asked = settings.population * (settings.generations + 1) * settings.islands
    if asked > max_evaluations:
        raise SettingsError(
            f"population x generations x islands is {asked:.3g} individuals, and this service evaluates at "
            f"most {max_evaluations:.3g} for a job: fewer generations, islands or individuals are needed"
        )
    if settings.library:
        _check_library(settings.library, settings.library_degree, settings.library_lags, inputs)


@lru_cache
def _check_library(name: str, degree: int, lags: int, inputs: int) -> None:
    """Raise the error of an invalid candidate library before the search does."""
    count_inputs(name, degree, lags, inputs)
    candidates(name, 1, lags, 1)


class JobMemoryError(IslandsError):
    """A job needs more memory than the cluster or the coordinator has."""


@dataclass(frozen=True, slots=True)
class JobMemory:
    """Estimated memory of the individuals of a search."""

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
    size = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    # The file contains "max" if the container has no limit.
    with suppress(OSError, ValueError):
        size = min(size, int(_CONTAINER_LIMIT.read_text()))
    return size


def _format(count: float) -> str:
    return f"{count / 1e9:.3g} GB" if count >= 1e9 else f"{count / 1e6:.3g} MB"
