"""Rate limits: everybody has so many requests at once and so many a second, and nobody uses up another's."""

import pytest

from islands_api.web import rate_limit
from islands_api.web.problems import RateLimitError
from islands_api.web.rate_limit import RateLimiter


@pytest.fixture
def clock(monkeypatch):
    """A clock that goes on when it is told to."""

    class Clock:
        now = 100.0

    monkeypatch.setattr(rate_limit, "monotonic", lambda: Clock.now)
    return Clock


def taken(bucket, who, most=1000):
    """How often somebody is let through."""
    for count in range(most):
        try:
            bucket.acquire(who)
        except RateLimitError:
            return count
    return most


def test_a_burst_is_let_through_and_then_so_many_a_second(clock):
    bucket = RateLimiter(rate=5.0, burst=20)
    assert taken(bucket, "a") == 20
    clock.now += 2.0
    assert taken(bucket, "a") == 10
    clock.now += 1000.0
    assert taken(bucket, "a") == 20


def test_nobody_uses_up_what_is_anothers(clock):
    bucket = RateLimiter(rate=5.0, burst=20)
    assert taken(bucket, "a") == 20
    assert taken(bucket, "b") == 20


def test_who_is_refused_is_told_when_to_come_back(clock):
    bucket = RateLimiter(rate=0.5, burst=1)
    bucket.acquire("a")
    clock.now += 0.5
    with pytest.raises(RateLimitError, match=r"more than 0\.5 requests per second: wait 1\.5 s") as refused:
        bucket.acquire("a")
    clock.now += refused.value.seconds
    bucket.acquire("a")


def test_to_be_refused_costs_nothing(clock):
    bucket = RateLimiter(rate=1.0, burst=1)
    bucket.acquire("a")
    for _ in range(100):
        with pytest.raises(RateLimitError):
            bucket.acquire("a")
    clock.now += 1.0
    bucket.acquire("a")


def test_a_dear_request_takes_more(clock):
    bucket = RateLimiter(rate=1.0, burst=20)
    bucket.acquire("a", 10.0)
    bucket.acquire("a", 10.0)
    with pytest.raises(RateLimitError):
        bucket.acquire("a", 10.0)
    assert taken(bucket, "a") == 0


def test_without_a_rate_nobody_is_refused(clock):
    assert taken(RateLimiter(rate=0.0, burst=1), "a") == 1000


def test_strangers_take_up_no_memory_without_end(clock, monkeypatch):
    monkeypatch.setattr(rate_limit, "_MAX_BUCKETS", 10)
    bucket = RateLimiter(rate=1.0, burst=2)
    bucket.acquire("first")
    for stranger in range(1000):
        bucket.acquire(f"address {stranger}")
    assert len(bucket._buckets) == 10
    assert taken(bucket, "first") == 2
