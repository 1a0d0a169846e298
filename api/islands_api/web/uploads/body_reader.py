"""Reading of a request's body within limits of time and size."""

import asyncio
from time import monotonic

from starlette.types import Message, Receive

from islands_api.web.problems import RequestTimeoutError
from islands_service.domain.job import QuotaError


class BodyReader:
    """Reader that ends a body that stalls, is too slow or exceeds the owner's quota.

    Parameters
    ----------
    receive : Receive
    timeout : float
        Longest time in seconds without a byte.
    rate : float
        Least mean rate in bytes per second, after the first ``timeout`` seconds; 0 for none. Only the time in
        which the service waits for the client counts.
    room : int, optional
        Maximum number of bytes.
    """

    def __init__(self, receive: Receive, timeout: float, rate: float, room: int | None = None) -> None:
        self._receive, self._timeout, self._rate, self._room = receive, timeout, rate, room
        self._received, self._waited, self._complete = 0, 0.0, False

    async def receive(self) -> Message:
        """Receive the next message.

        Raises
        ------
        RequestTimeoutError
            No byte arrived in time, or the body is too slow.
        QuotaError
            The body is longer than the owner's quota allows.
        """
        if self._complete:
            return await self._receive()
        patience = self._timeout
        if self._rate:
            patience = min(patience, self._timeout + self._received / self._rate - self._waited)
        start = monotonic()
        try:
            async with asyncio.timeout(max(patience, 0.0)):
                message = await self._receive()
        except TimeoutError:
            self._waited += monotonic() - start
            raise RequestTimeoutError(
                f"{self._received / 1e6:.3g} MB of the body arrived in {self._waited:.3g} s, but the service "
                f"needs some bytes every {self._timeout:g} s and {self._rate:g} bytes per second: use a "
                "faster connection, or compress the file (.gz)"
            ) from None
        self._waited += monotonic() - start
        self._received += len(message.get("body", b""))
        self._complete = not message.get("more_body", False)
        if self._room is not None and self._received > self._room:
            raise QuotaError("the data sets would take more bytes than their owner may store: delete some")
        return message
