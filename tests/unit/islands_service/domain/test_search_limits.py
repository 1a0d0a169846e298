"""Estimated memory of a job: every limit counts the individuals of all islands, and names figures."""

import pytest

from islands.errors import SettingsError
from islands_service.domain.job_spec import Identification
from islands_service.domain.search_limits import (
    ACTOR_BYTES,
    COORDINATOR_BYTES,
    JobMemory,
    JobMemoryError,
)
from islands_service.intake import job_validation
from islands_service.settings import ServiceSettings
from support.service import spec

LARGE = {"population": 100_000, "islands": 256, "generations": 10}


def order(**settings):
    return Identification(**spec("set", settings=settings))


def test_large_population_on_many_islands_is_rejected_with_the_figures():
    with pytest.raises(SettingsError, match="256 islands of 100000 individuals need about 292 GB") as error:
        job_validation.validate_job(order(**LARGE), "me", None, ServiceSettings(max_job_memory=8_000_000_000))
    assert "may take 8 GB: take fewer islands or a smaller population, at most 701754 individuals" in str(
        error.value
    )


@pytest.mark.parametrize("preset", ["auto", "hysteresis"])
def test_default_limit_is_half_of_the_memory_of_the_machine(preset, monkeypatch):
    size = 2 * 32 * 1000 * (ACTOR_BYTES + COORDINATOR_BYTES)
    wanted = Identification(**{**spec("set", settings={"population": 1000, "islands": 32}), "preset": preset})
    monkeypatch.setattr(job_validation, "machine_memory", lambda: size - 2)
    with pytest.raises(SettingsError, match="of memory, and a job on this service may take"):
        job_validation.validate_job(wanted, "me", None, ServiceSettings())
    monkeypatch.setattr(job_validation, "machine_memory", lambda: size)
    with pytest.raises(AttributeError):  # it reaches the data sets, of which there are none here
        job_validation.validate_job(wanted, "me", None, ServiceSettings())


def test_memory_of_actors_and_coordinator_is_checked_separately():
    memory = JobMemory(1000, 10)
    memory.check_available(10_000 * ACTOR_BYTES, 10_000 * COORDINATOR_BYTES)
    with pytest.raises(JobMemoryError, match="in actors, and the cluster has 74 MB"):
        memory.check_available(10_000 * ACTOR_BYTES - 1, 1e12)
    with pytest.raises(JobMemoryError, match="in the coordinator, whose machine has 40 MB"):
        memory.check_available(1e12, 10_000 * COORDINATOR_BYTES - 1)
