"""Connection settings and retry policy of both clients."""

import os
import ssl
from collections.abc import Iterator
from contextlib import contextmanager
from email.utils import parsedate_to_datetime
from http import HTTPStatus
from itertools import chain, repeat
from math import inf
from time import monotonic
from typing import Any

import httpx

from islands.distribution import read_version
from islands.errors import SettingsError
from islands_api.client.responses import ServiceUnreachableError

#: Seconds to wait for an answer. The service takes up to two minutes to read an upload.
ANSWER_TIMEOUT = 150.0

#: Seconds to wait for a connection.
CONNECT_TIMEOUT = 10.0

#: Longest time, in seconds, for which the service holds back the answer about an unchanged job.
LONG_POLL_SECONDS = 30.0

#: Seconds after its deadline for which an answer is still awaited.
GRACE_SECONDS = 5.0

#: Seconds between the first attempts. A restarted service is back in one or two seconds.
RETRY_DELAYS = (0.1, 0.2, 0.4, 0.8)

#: Seconds between later attempts.
LAST_RETRY_DELAY = 1.0

#: Status codes after which the same call may succeed. The call was not carried out.
TRANSIENT_STATUS = (HTTPStatus.TOO_MANY_REQUESTS, HTTPStatus.SERVICE_UNAVAILABLE)

#: Status codes of a gateway. The call may have been carried out.
AMBIGUOUS_STATUS = (HTTPStatus.BAD_GATEWAY, HTTPStatus.GATEWAY_TIMEOUT)


def make_headers(key: str | None) -> dict[str, str]:
    """Return the headers of every request.

    Raises
    ------
    SettingsError
        The key is malformed. The message does not contain the key.
    """
    headers = {"User-Agent": f"islands/{read_version()}"}
    if key is None:
        return headers
    # A key read from a file ends with a line break. httpx would show other invalid characters in its error.
    key = key.strip()
    if not key or not all("!" <= letter <= "~" for letter in key):
        raise SettingsError(
            "the key is empty, or has characters that no key has: give it as 'islands admin keys' printed it"
        )
    return {**headers, "Authorization": f"Bearer {key}"}


def check_url(url: str) -> str:
    """Return the address of a service unchanged.

    Raises
    ------
    SettingsError
        The address is not an HTTP or HTTPS URL with a host.
    """
    try:
        parsed = httpx.URL(url)
    except httpx.InvalidURL as error:
        raise SettingsError(f"{url!r} is not an address ({error}): write http://HOST:PORT") from error
    if parsed.scheme not in ("http", "https") or not parsed.host:
        raise SettingsError(f"{url!r} is not the address of a service: write http://HOST:PORT")
    return url


def make_ssl_context(verify: Any) -> Any:
    """Return ``verify`` for httpx; read a file of certificates."""
    return ssl.create_default_context(cafile=verify) if isinstance(verify, str | os.PathLike) else verify


def make_timeout(seconds: float, until: float = inf) -> httpx.Timeout:
    """Return the timeout of a request, limited to a short time after a deadline on the monotonic clock."""
    seconds = min(seconds, max(0.0, until - monotonic()) + GRACE_SECONDS)
    return httpx.Timeout(seconds, connect=min(seconds, CONNECT_TIMEOUT))


def long_poll_seconds(timeout: float, until: float) -> float:
    """Return the seconds for which the service may hold back an answer so that it arrives in time."""
    return max(0.0, min(LONG_POLL_SECONDS, timeout / 2, until - monotonic()))


class RetryPolicy:
    """Decides after each attempt of a call whether and when to repeat it.

    Parameters
    ----------
    url : str
        Address of the service, for messages.
    retry : float
        Seconds, from the first failure on, during which a call is repeated.
    until : float
        Deadline on the monotonic clock: no attempt begins after it.
    """

    def __init__(self, url: str, retry: float, until: float = inf) -> None:
        self._url, self._retry, self._latest = url, retry, until
        self.reset()

    def reset(self) -> None:
        """Forget earlier failures, after data has arrived."""
        self._until: float | None = None
        self._delays = chain(RETRY_DELAYS, repeat(LAST_RETRY_DELAY))

    def delay_after_stream(self) -> float:
        """Return the seconds until a stream that ended without an error is opened again."""
        return RETRY_DELAYS[0]

    def delay_after_error(self, error: httpx.TransportError, repeatable: bool = True) -> float:
        """Return the seconds until the next attempt after an attempt without an answer.

        Raises
        ------
        ServiceUnreachableError
            The certificate is not trusted, repeating the call could do harm, or the time for it is over.
        """
        if is_untrusted(error):
            raise ServiceUnreachableError(
                f"the certificate of the service at {self._url} is not trusted ({error}): give the file of "
                "its authority as `verify`, to the command line in SSL_CERT_FILE"
            ) from error
        reason = describe_error(error)
        # Without a connection nothing was sent: the call can be repeated.
        if not (repeatable or isinstance(error, httpx.ConnectError | httpx.ConnectTimeout)):
            raise ServiceUnreachableError(
                f"the service at {self._url} closed the connection before it answered ({reason}): the call "
                "may have been carried out, check before you repeat it"
            ) from error
        pause = self._next_delay(0.0)
        if pause is None:
            raise ServiceUnreachableError(
                f"the service at {self._url} does not answer ({reason}): check that it runs and that the "
                "address is right"
            ) from error
        return pause

    def delay_after_response(self, response: httpx.Response, repeatable: bool = True) -> float | None:
        """Return the seconds until the next attempt, or None if the response is the answer."""
        transient = (*TRANSIENT_STATUS, *AMBIGUOUS_STATUS) if repeatable else TRANSIENT_STATUS
        return self._next_delay(parse_retry_after(response)) if response.status_code in transient else None

    def _next_delay(self, least: float) -> float | None:
        if self._until is None:
            self._until = min(monotonic() + self._retry, self._latest)
        pause = max(next(self._delays), least)
        return pause if monotonic() + pause <= self._until else None


def is_untrusted(error: BaseException) -> bool:
    """Return whether a certificate caused an error. Such an error is permanent."""
    return any(isinstance(each, ssl.SSLCertVerificationError) for each in _get_causes(error))


def describe_error(error: BaseException) -> str:
    """Return the operating system's message of an error if it has one, else that of the library."""
    for each in reversed(_get_causes(error)):
        if isinstance(each, OSError) and each.errno is not None:
            return os.strerror(each.errno) if each.errno > 0 else str(each.strerror)
    return str(error) or type(error).__name__


def _get_causes(error: BaseException) -> list[BaseException]:
    """Return an error and its chain of causes."""
    found, cause = [error], error.__cause__ or error.__context__
    while cause is not None:
        found.append(cause)
        cause = cause.__cause__ or cause.__context__
    return found


def parse_retry_after(response: httpx.Response) -> float:
    """Return the seconds of the Retry-After header, a number or a date; 0 if it is missing or malformed."""
    text = response.headers.get("retry-after", "").strip()
    if text.isascii() and text.isdecimal():
        return float(text)
    try:
        # The date refers to the clock of the service.
        target, now = (parsedate_to_datetime(each) for each in (text, response.headers.get("date", "")))
        return max(0.0, (target - now).total_seconds())
    except (TypeError, ValueError):
        return 0.0


@contextmanager
def translate_timeout(job: str, seconds: float, until: float) -> Iterator[None]:
    """Turn an unreachable service into a timeout if the deadline has come.

    Raises
    ------
    TimeoutError
        The service is unreachable at the deadline.
    """
    try:
        yield
    except ServiceUnreachableError as error:
        if monotonic() + LAST_RETRY_DELAY < until:
            raise
        raise TimeoutError(f"job {job} is not known to have ended after {seconds:g} s: {error}") from error
