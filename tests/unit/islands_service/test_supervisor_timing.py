"""The supervisor's waits and its patience, on a clock that the test moves."""

import io
import os
import signal
import sys
from collections.abc import Callable, Iterator

import pytest

from islands_service import supervisor
from islands_service.supervisor import Role
from support.processes import alive, eventually

#: Children: one that ends at once, one that never gives a sign of life, one that gives them all the time.
ENDS = "pass"
SILENT = "import signal; signal.pause()"
LIVE = """
import os, time
while True:
    os.write(int(os.environ["ISLANDS_LIFELINE"]), b".")
    time.sleep(0.005)
"""
ONE_SIGN = f"import os; os.write(int(os.environ['ISLANDS_LIFELINE']), b'.'); {SILENT}"


class Tended:
    """A role that a supervisor tends at times that the test chooses."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, script: str, patience: float) -> None:
        self.now, self.log = 1000.0, io.StringIO()
        self.role = Role("doors", [sys.executable, "-S", "-E", "-c", script], patience)
        monkeypatch.setattr(supervisor, "monotonic", lambda: self.now)
        self.look()

    def look(self, seconds: float = 0.0) -> None:
        """Tend the role so many seconds later."""
        self.now += seconds
        supervisor._tend(self.role, [self.role], os.environ, self.now, self.log)

    @property
    def runs(self) -> bool:
        return self.role.process is not None

    def ended(self, after: float) -> None:
        """Have the process end, however it does, and be found so many seconds later."""
        process = self.role.process
        assert process is not None
        if alive([process.pid]):
            eventually(lambda: process.poll() is not None)
        self.look(after)
        assert not self.runs

    def waits(self, seconds: float) -> bool:
        """Tell whether the next start comes after so many seconds, and not before."""
        self.look(seconds - 0.001)
        early = self.runs
        self.look(0.002)
        return self.runs and not early

    def heard(self) -> None:
        """Wait until a sign of life is heard at this time."""

        def listened() -> bool:
            self.look()
            return self.role.heard == self.now

        eventually(listened)


Tend = Callable[..., Tended]


@pytest.fixture
def tend(monkeypatch: pytest.MonkeyPatch) -> Iterator[Tend]:
    """Start a role; its process is gone in the end."""
    made: list[Tended] = []

    def start(script: str, patience: float = 60.0) -> Tended:
        made.append(Tended(monkeypatch, script, patience))
        return made[-1]

    yield start
    for each in made:
        if each.role.process is not None:
            each.role.process.kill()
            each.ended(0.0)


def test_a_role_that_ends_at_once_waits_twice_as_long_every_time_up_to_a_limit(
    tend: Tend, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(supervisor, "_MOST_BACKOFF", 0.8)
    role = tend(ENDS)
    for expected in (0.2, 0.4, 0.8, 0.8):
        role.ended(0.1)
        assert role.waits(expected), expected


def test_a_role_that_has_lived_long_enough_is_started_again_at_once_and_begins_with_the_first_wait(
    tend: Tend,
) -> None:
    role = tend(ENDS)
    for expected in (0.2, 0.4):
        role.ended(0.1)
        assert role.waits(expected)
    role.ended(supervisor._PROVEN + 0.1)
    role.look()
    assert role.runs
    role.ended(0.1)
    assert role.waits(0.2)


@pytest.mark.parametrize("stopped", [False, True], ids=["silent", "stopped"])
def test_a_role_that_says_nothing_any_more_is_ended_after_its_patience(tend: Tend, stopped: bool) -> None:
    role = tend(LIVE if stopped else ONE_SIGN, patience=5.0)
    role.heard()
    process = role.role.process
    assert process is not None
    if stopped:
        os.kill(process.pid, signal.SIGSTOP)
        role.look()  # what it has said before
    role.look(4.9)
    assert alive([process.pid])
    role.look(0.2)
    role.ended(0.1)
    assert process.returncode == -signal.SIGKILL
    assert "doors has said nothing for 5.1 s: it is started again" in role.log.getvalue()


def test_a_role_that_gives_signs_of_life_is_left_alone(tend: Tend) -> None:
    role = tend(LIVE, patience=5.0)
    process = role.role.process
    for _ in range(5):
        role.heard()
        role.look(4.9)
    assert process is not None
    assert alive([process.pid])
    assert role.log.getvalue() == ""


def test_a_role_that_has_not_spoken_yet_is_starting_and_may_take_longer(tend: Tend) -> None:
    """Ray takes seconds, and kernels a minute where they have to be compiled."""
    role = tend(SILENT, patience=5.0)
    process = role.role.process
    assert process is not None
    role.look(supervisor._STARTING - 0.1)
    assert alive([process.pid])
    role.look(0.2)
    role.ended(0.1)
    assert process.returncode == -signal.SIGKILL
    assert "doors has said nothing for 120.1 s" in role.log.getvalue()
