"""Rate limits: a token bucket for each client."""

from collections import OrderedDict
from time import monotonic

from islands_api.web.problems import RateLimitError

#: Maximum number of buckets. The least recently used one is dropped; it has refilled in the meantime.
_MAX_BUCKETS = 10_000


class RateLimiter:
    """Token bucket rate limiter.

    Parameters
    ----------
    rate : float
        Requests per second; 0 for no limit.
    burst : int
        Capacity of a bucket: requests that may arrive at once.
    """

    def __init__(self, rate: float, burst: int) -> None:
        self._rate, self._burst = rate, burst
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def acquire(self, client: str, tokens: float = 1.0) -> None:
        """Take tokens from the bucket of a client.

        Raises
        ------
        RateLimitError
            The bucket has too few tokens.
        """
        if not self._rate:
            return
        now = monotonic()
        left, at = self._buckets.get(client, (float(self._burst), now))
        left = min(self._burst, left + (now - at) * self._rate)
        if left < tokens:
            wait = (tokens - left) / self._rate
            raise RateLimitError(
                f"more than {self._rate:g} requests per second: wait {wait:.1f} s; to follow a job, read its "
                "events or use ?wait=30",
                wait,
            )
        self._buckets[client] = left - tokens, now
        self._buckets.move_to_end(client)
        while len(self._buckets) > _MAX_BUCKETS:
            self._buckets.popitem(last=False)
