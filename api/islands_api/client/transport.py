"""What both clients know of the way to the service: how long to wait, when to try again."""

from collections.abc import Iterator
from importlib.metadata import version
from itertools import chain, repeat
from typing import Any

import httpx

from islands_api.client.calls import Call
from islands_api.client.errors import Unreachable

#: Seconds for an answer; it covers `WAIT`, for which the service holds an answer back.
PATIENCE, WAIT = 60.0, 30.0


def headers_of(key: str | None) -> dict[str, str]:
    """Return what every request says."""
    headers = {"User-Agent": f"islands/{version('islands')}"}
    return headers if key is None else {**headers, "Authorization": f"Bearer {key}"}


def delays() -> Iterator[float]:
    """Yield the seconds between tries: a service that was started again is back in a second or two."""
    return chain((0.1, 0.2, 0.4, 0.8), repeat(1.0))


def unanswered(error: httpx.TransportError, call: Call[Any]) -> bool:
    """Tell whether a call may be sent again after an error on the way."""
    # A connection that never came about has carried nothing.
    return call.repeatable or isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)


def unreachable(url: str, error: httpx.TransportError) -> Unreachable:
    """Return what to raise where no answer came."""
    return Unreachable(f"the service at {url} does not answer: {str(error) or type(error).__name__}")
