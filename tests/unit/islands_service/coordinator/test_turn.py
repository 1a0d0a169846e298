"""Turn of a job."""

import pytest

from islands_service.coordinator import turn as turn_module
from islands_service.coordinator.turn import Turn, TurnOver


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
