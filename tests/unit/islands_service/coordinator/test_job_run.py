"""Runner of a job: its owner sees why no epoch is computed, and a turn ends at a checkpoint."""

import pytest

from islands_service.coordinator import job_run
from islands_service.coordinator import job_run as turn_module
from islands_service.coordinator.job_run import JobNotes, Turn, TurnOver
from islands_service.runtime import actor_pool
from islands_service.runtime.actor_pool import IslandActorPool
from support.stores import ALICE, claimed, submitted

WAITING = "waiting for capacity: 0 of 2 island actors are ready, the others need a CPU each"
LOST = "an actor was lost: its islands continue from their last epoch"


@pytest.fixture
def lease(store):
    submitted(store)
    return claimed(store)


def progress_of(store, lease):
    return store.jobs.get(ALICE, lease.job.id).progress


def test_phase_before_the_first_report_is_stored_at_once(store, lease):
    JobNotes(lease, store).add(LOST)
    store.leases.release(lease)
    again = claimed(store)
    JobNotes(again, store).begin("reading the record")
    assert progress_of(store, again) == {"phase": "reading the record"}


def test_a_change_between_two_reports_keeps_the_fraction_and_no_old_time_left(store, lease):
    notes = JobNotes(lease, store)
    notes.complete({"phase": "screening", "fraction": 0.1, "seconds_left": 20.0})
    notes.report({"phase": "starting", "note": "waiting for Ray"})
    assert progress_of(store, lease) == {"phase": "starting", "note": "waiting for Ray", "fraction": 0.1}


def test_message_about_waiting_is_repeated_while_the_progress_shows_it(monkeypatch):
    """Otherwise the owner would no longer see it after a minute."""
    assert actor_pool.WAITING_NOTICE_EVERY < job_run.SHOWN_SECONDS
    said = []
    monkeypatch.setattr(actor_pool, "put_problem", lambda problem: problem)
    pool = IslandActorPool(None, 2, said.append)
    pool._size, pool._joining = 2, {0: None, 1: None}
    begin = pool._waiting_since
    for seconds in range(100):
        pool._report_waiting(begin + seconds)
    assert said == [WAITING] * 4
    assert said[0].startswith(job_run.WAITING)


def test_a_turn_begins_with_a_checkpoint_and_ends_if_others_wait(monkeypatch):
    """The start of a job takes a minute on a busy machine, and is repeated in each turn."""
    clock, waiting = [0.0], []
    monkeypatch.setattr(turn_module, "monotonic", lambda: clock[0])
    turn = Turn(30.0, lambda: bool(waiting))
    for clock[0] in (90.0, 95.0, 119.0, 125.0, 500.0):
        turn.end_if_over()
    waiting.append("other")
    with pytest.raises(TurnOver, match="another owner waits"):
        turn.end_if_over()
    later = Turn(30.0, lambda: bool(waiting))
    for clock[0] in (600.0, 610.0, 630.0):
        later.end_if_over()
