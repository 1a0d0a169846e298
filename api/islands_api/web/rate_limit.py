"""Rate limits: a bucket of tokens for each who asks."""

from collections import OrderedDict
from time import monotonic

from islands_api.web.problems import RateLimitError

#: Buckets that are remembered: who has not asked for longest is forgotten, and is full by then.
_REMEMBERED = 10_000


class RateLimiter:
    """Lets everybody ask so often, and no more.

    Parameters
    ----------
    rate : float
        Requests a second; 0 does not limit.
    burst : int
        Requests that may come at once.
    """

    def __init__(self, rate: float, burst: int) -> None:
        self._rate, self._burst = rate, burst
        self._buckets: OrderedDict[str, tuple[float, float]] = OrderedDict()

    def acquire(self, who: str, tokens: float = 1.0) -> None:
        """Take tokens out of a bucket.

        Raises
        ------
        RateLimitError
        """
        if not self._rate:
            return
        now = monotonic()
        left, at = self._buckets.get(who, (float(self._burst), now))
        left = min(self._burst, left + (now - at) * self._rate)
        if left < tokens:
            wait = (tokens - left) / self._rate
            raise RateLimitError(
                f"more than {self._rate:g} requests a second: wait {wait:.1f} s; to follow a job, watch its "
                "events or ask with ?wait=30",
                wait,
            )
        self._buckets[who] = left - tokens, now
        self._buckets.move_to_end(who)
        while len(self._buckets) > _REMEMBERED:
            self._buckets.popitem(last=False)
