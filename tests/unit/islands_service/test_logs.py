"""`OutageLog`: an outage has a line at its begin, one in each minute, and one at its end."""

import pytest
import structlog

from islands_service.logs import OutageLog


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def outage(clock: Clock) -> OutageLog:
    return OutageLog("store away", "store back", clock)


def retry(outage: OutageLog, clock: Clock, seconds: float, every: float = 0.5) -> None:
    """Fail again and again for some seconds."""
    until = clock.now + seconds
    while clock.now < until:
        outage.fail(OSError("refused"), job="a")
        clock.now += every


def test_an_outage_is_logged_at_its_begin_each_minute_and_at_its_end(outage: OutageLog, clock: Clock) -> None:
    with structlog.testing.capture_logs() as logs:
        retry(outage, clock, 150.0)
        outage.succeed()
        outage.succeed()
    first = {"event": "store away", "reason": "refused", "job": "a", "log_level": "warning"}
    assert logs == [
        first,
        {**first, "failures": 121, "seconds": 60.0},
        {**first, "failures": 241, "seconds": 120.0},
        {"event": "store back", "failures": 300, "seconds": 150.0, "log_level": "info"},
    ]


def test_a_store_that_fails_again_and_again_is_logged_once_a_minute(outage: OutageLog, clock: Clock) -> None:
    with structlog.testing.capture_logs() as logs:
        for _ in range(59):
            retry(outage, clock, 0.5)
            outage.succeed()
            clock.now += 0.5
    assert [entry["event"] for entry in logs] == ["store away", "store back"]
