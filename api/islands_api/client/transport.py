"""What both clients know of the way to the service: how long to wait, when to try again, when to give up."""

import os
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from email.utils import parsedate_to_datetime
from http import HTTPStatus
from importlib.metadata import version
from itertools import chain, repeat
from math import inf
from time import monotonic
from typing import Any

import httpx

from islands.errors import SettingsError
from islands_api.client.errors import ServiceUnreachableError

#: Seconds for an answer: the service itself takes up to two minutes to read an upload.
PATIENCE = 150.0

#: Seconds for a connection, for which an answer of a job that has not changed is held back, and by which an
#: answer may come later than that.
CONNECT, WAIT, GRACE = 10.0, 30.0, 5.0

#: Seconds between tries: a service that was started again is back in a second or two.
DELAYS, LAST_DELAY = (0.1, 0.2, 0.4, 0.8), 1.0

#: Answers after which the same call may succeed, and those that leave open whether it was carried out.
PASSING = (HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE)
DOUBTFUL = (HTTPStatus.BAD_GATEWAY, HTTPStatus.GATEWAY_TIMEOUT)


def make_headers(key: str | None) -> dict[str, str]:
    """Return what every request says.

    Raises
    ------
    SettingsError
        The key cannot be one; it is not shown.
    """
    headers = {"User-Agent": f"islands/{version('islands')}"}
    if key is None:
        return headers
    # One that was read from a file ends with the line. What else HTTP refuses, it would refuse by showing it.
    key = key.strip()
    if not key or not all("!" <= letter <= "~" for letter in key):
        raise SettingsError(
            "the key is empty, or has characters that no key has: give it as 'islands keys create' printed it"
        )
    return {**headers, "Authorization": f"Bearer {key}"}


def parse_address(url: str) -> str:
    """Return a service's address as it is.

    Raises
    ------
    SettingsError
        It is none.
    """
    try:
        parsed = httpx.URL(url)
    except httpx.InvalidURL as error:
        raise SettingsError(f"{url!r} is no address ({error}): write http://HOST:PORT") from error
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise SettingsError(f"{url!r} is no address of a service: write http://HOST:PORT")
    return url


def ssl_context(verify: Any) -> Any:
    """Return whom to trust, as httpx takes it: a file of certificates is read."""
    return ssl.create_default_context(cafile=verify) if isinstance(verify, str | os.PathLike) else verify


def parse_timeout(patience: float, until: float = inf) -> httpx.Timeout:
    """Return how long a request may take that is of no use any more a little after a time of the clock."""
    patience = min(patience, max(0.0, until - monotonic()) + GRACE)
    return httpx.Timeout(patience, connect=min(patience, CONNECT))


def retry_after(patience: float, until: float) -> float:
    """Return for how many seconds the service may hold an answer back, so that it still comes in time."""
    return max(0.0, min(WAIT, patience / 2, until - monotonic()))


class RetryPolicy:
    """Decides after each try of a call whether there is another one, and when.

    Parameters
    ----------
    url : str
        Of the service, for messages.
    retry : float
        Seconds from the first failure on for which a call is sent again.
    until : float
        No try begins after this time of the clock.
    """

    def __init__(self, url: str, retry: float, until: float = inf) -> None:
        self._url, self._retry, self._latest = url, retry, until
        self.succeeded()

    def succeeded(self) -> None:
        """Forget the failures: something has come through."""
        self._until: float | None = None
        self._delays = chain(DELAYS, repeat(LAST_DELAY))

    def ended(self) -> float:
        """Return the seconds until a stream is taken up again that has ended in good order."""
        return DELAYS[0]

    def failed(self, error: httpx.TransportError, repeatable: bool = True) -> float:
        """Return the seconds until the next try, after one to which there was no answer.

        Raises
        ------
        ServiceUnreachableError
            There is no next try.
        """
        if untrusted(error):
            raise ServiceUnreachableError(
                f"the certificate of the service at {self._url} is not trusted ({error}): give the file of "
                "its authority as `verify`, to the command line in SSL_CERT_FILE"
            ) from error
        reason = reason_of(error)
        # A connection that never came about has carried nothing.
        if not (repeatable or isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)):
            raise ServiceUnreachableError(
                f"the service at {self._url} broke off before it answered ({reason}): it may have done what "
                "was asked, look whether it has"
            ) from error
        pause = self._pause(0.0)
        if pause is None:
            raise ServiceUnreachableError(
                f"the service at {self._url} does not answer ({reason}): is it running, and is this its "
                "address?"
            ) from error
        return pause

    def answered(self, response: httpx.Response, repeatable: bool = True) -> float | None:
        """Return the seconds until the next try, after one with an answer; None if that is the answer."""
        passing = (*PASSING, *DOUBTFUL) if repeatable else PASSING
        return self._pause(asked_to_wait(response)) if response.status_code in passing else None

    def _pause(self, least: float) -> float | None:
        if self._until is None:
            self._until = min(monotonic() + self._retry, self._latest)
        pause = max(next(self._delays), least)
        return pause if monotonic() + pause <= self._until else None


def untrusted(error: BaseException) -> bool:
    """Tell whether an error comes from a certificate: it will not get better."""
    return any(isinstance(each, ssl.SSLCertVerificationError) for each in _causes(error))


def reason_of(error: BaseException) -> str:
    """Say what the matter is, as the system says it: the libraries between have words of their own."""
    for each in reversed(_causes(error)):
        if isinstance(each, OSError) and each.errno is not None:
            return os.strerror(each.errno) if each.errno > 0 else str(each.strerror)
    return str(error) or type(error).__name__


def _causes(error: BaseException) -> list[BaseException]:
    found, cause = [error], error.__cause__ or error.__context__
    while cause is not None:
        found.append(cause)
        cause = cause.__cause__ or cause.__context__
    return found


def asked_to_wait(response: httpx.Response) -> float:
    """Return the seconds of an answer's Retry-After, a number or a date; 0 where there is none."""
    text = response.headers.get("retry-after", "").strip()
    if text.isascii() and text.isdecimal():
        return float(text)
    try:
        # The service's own clock is what its date means.
        told, now = (parsedate_to_datetime(each) for each in (text, response.headers.get("date", "")))
        return max(0.0, (told - now).total_seconds())
    except (TypeError, ValueError):
        return 0.0


@contextmanager
def in_time(job: str, seconds: float, until: float) -> Iterator[None]:
    """Turn a service that is away when the time is over into the end of the time.

    Raises
    ------
    TimeoutError
    """
    try:
        yield
    except ServiceUnreachableError as error:
        if monotonic() + LAST_DELAY < until:
            raise
        raise TimeoutError(f"job {job} is not known to have ended after {seconds:g} s: {error}") from error
