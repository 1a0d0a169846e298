"""Rate limits: each client has a separate token bucket."""

import pytest

from islands_api.web.limits import rate as rate_limit
from islands_api.web.limits.rate import RateLimiter
from islands_api.web.problems import RateLimitError


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test advances."""

    class Clock:
        now = 100.0

    monkeypatch.setattr(rate_limit, "monotonic", lambda: Clock.now)
    return Clock


def count_accepted(bucket, client, most=1000):
    """Return the number of requests of a client that are accepted."""
    for count in range(most):
        try:
            bucket.acquire(client)
        except RateLimitError:
            return count
    return most


def test_a_full_bucket_allows_a_burst_and_refills_at_the_rate(clock):
    bucket = RateLimiter(rate=5.0, burst=20)
    assert count_accepted(bucket, "a") == 20
    clock.now += 2.0
    assert count_accepted(bucket, "a") == 10
    clock.now += 1000.0
    assert count_accepted(bucket, "a") == 20


def test_each_client_has_a_separate_bucket(clock):
    bucket = RateLimiter(rate=5.0, burst=20)
    assert count_accepted(bucket, "a") == 20
    assert count_accepted(bucket, "b") == 20


def test_a_rejection_gives_the_time_to_wait(clock):
    bucket = RateLimiter(rate=0.5, burst=1)
    bucket.acquire("a")
    clock.now += 0.5
    with pytest.raises(RateLimitError, match=r"more than 0\.5 requests per second: wait 1\.5 s") as refused:
        bucket.acquire("a")
    clock.now += refused.value.seconds
    bucket.acquire("a")


def test_an_expensive_request_takes_more_tokens(clock):
    bucket = RateLimiter(rate=1.0, burst=20)
    bucket.acquire("a", 10.0)
    bucket.acquire("a", 10.0)
    with pytest.raises(RateLimitError):
        bucket.acquire("a", 10.0)
    assert count_accepted(bucket, "a") == 0


def test_the_number_of_buckets_is_bounded(clock, monkeypatch):
    monkeypatch.setattr(rate_limit, "_MAX_BUCKETS", 10)
    bucket = RateLimiter(rate=1.0, burst=2)
    bucket.acquire("first")
    for number in range(1000):
        bucket.acquire(f"address {number}")
    assert len(bucket._buckets) == 10
    assert count_accepted(bucket, "first") == 2
