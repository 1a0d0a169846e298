"""Sweeps while the clock of the database jumps."""

import errno

import pytest

from islands_service.coordinator import sweeper as sweeper_module
from islands_service.coordinator.sweeper import Sweeper
from islands_service.domain.job import JobState
from islands_service.settings import ServiceSettings
from islands_service.store import Store
from islands_service.store.blobs import Blobs
from islands_service.store.database import StoreUnavailableError
from islands_service.store.retention import Retention
from support.stores import ALICE, job_in, turn_clock

DAY = 86_400.0


@pytest.fixture
def store(sqlite_database):
    with Store(sqlite_database) as opened:
        yield opened


@pytest.fixture
def sweep(store, tmp_path, monkeypatch):
    """Return a function that sweeps now; jobs are kept for a day."""
    monkeypatch.setattr(sweeper_module, "SWEEP_INTERVAL", -1.0)
    settings = ServiceSettings(data_dir=tmp_path, retention=DAY)
    return Sweeper(settings, store, Blobs(settings.blobs), -1.0).sweep_if_due


@pytest.fixture
def advance(store, monkeypatch):
    """Return a function that lets the clock of the database jump."""
    read = Retention.read_clock

    def jump(seconds):
        turn_clock(store, seconds)
        monkeypatch.setattr(Retention, "read_clock", lambda retention: read(retention) + seconds)

    return jump


def listed(store):
    return [job.id for job in store.jobs.page(ALICE).jobs]


def test_results_survive_a_jump_of_the_clock_that_is_repaired(store, sweep, advance):
    job = job_in(store, JobState.SUCCEEDED)
    sweep()
    advance(400 * DAY)
    for _ in range(3):
        sweep()
    assert listed(store) == [job.id]
    turn_clock(store, -400 * DAY)
    advance(0.0)
    sweep()
    assert listed(store) == [job.id]


def test_jump_that_is_not_repaired_is_the_time_after_a_pause(store, sweep, advance, monkeypatch):
    job_in(store, JobState.SUCCEEDED)
    sweep()
    advance(2 * DAY)
    sweep()
    assert listed(store)
    monkeypatch.setattr(sweeper_module, "CLOCK_PAUSE", 0.0)
    sweep()
    assert listed(store) == []


@pytest.mark.parametrize("error", [StoreUnavailableError("away"), OSError(errno.EROFS, "read-only")])
def test_failed_sweep_does_not_end_the_coordinator(sweep, monkeypatch, error):
    """It would fail after every restart of the coordinator, which could run no job."""

    def fail(*_):
        raise error

    monkeypatch.setattr(Blobs, "sweep", fail)
    sweep()
    monkeypatch.undo()
    sweep()
