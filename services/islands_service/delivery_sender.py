"""Sender of webhook deliveries: claims them in the store, sends them, and stores what became of each."""

import asyncio
import base64
import hashlib
import hmac
from collections.abc import Awaitable, Callable
from time import monotonic, time
from typing import Any, Protocol

import structlog

from islands_service.domain.webhook import DueDelivery
from islands_service.logs import OutageLog
from islands_service.outbound import CheckedClient, OutboundFailedError, OutboundRefusedError
from islands_service.store.database import StoreError
from islands_service.store.webhooks import Deliveries

log = structlog.get_logger()

#: Seconds between two searches for due deliveries.
POLL_SECONDS = 1.0

#: Time limit of one request in seconds.
REQUEST_SECONDS = 15.0

#: Seconds for which a webhook is leased. Longer than a request, whose outcome has to be stored, too.
LEASE_SECONDS = 30.0

#: Maximum number of requests at once, each to another webhook.
MAX_REQUESTS = 100

#: Maximum number of deliveries of one claim: 20 take some 15 ms, for which other writes of SQLite wait.
MAX_CLAIMS = 20

#: Called with the outcome of each attempt, ``delivered``, ``retried`` or ``failed``, and its seconds.
Observer = Callable[[str, float], None]


class RunBlocking(Protocol):
    """Runs an operation that waits for the database in a thread."""

    def __call__(self, operation: Callable[..., Any], *arguments: Any) -> Awaitable[Any]:
        """Return the value of the operation."""


class DeliverySender:
    """Sends due deliveries until it is cancelled. Any number of processes may send at the same time.

    Parameters
    ----------
    deliveries : Deliveries
    client : CheckedClient
    run_blocking : RunBlocking
    observe : callable
        See `Observer`.
    """

    def __init__(
        self, deliveries: Deliveries, client: CheckedClient, run_blocking: RunBlocking, observe: Observer
    ) -> None:
        self._deliveries, self._client = deliveries, client
        self._run_blocking, self._observe = run_blocking, observe
        self._sending: set[asyncio.Task[None]] = set()
        self._outage = OutageLog("deliveries not read", "deliveries read again")

    async def run(self) -> None:
        """Send deliveries. A request that is being sent when this is cancelled is repeated later."""
        try:
            while True:
                if await self._start_due():
                    continue
                if self._sending:
                    # A webhook is free for its next delivery when a request has ended.
                    await asyncio.wait(
                        self._sending, timeout=POLL_SECONDS, return_when=asyncio.FIRST_COMPLETED
                    )
                else:
                    await asyncio.sleep(POLL_SECONDS)
        finally:
            for task in self._sending:
                task.cancel()
            await asyncio.gather(*self._sending, return_exceptions=True)

    async def _start_due(self) -> bool:
        """Start to send due deliveries; return whether there may be more."""
        free = min(MAX_REQUESTS - len(self._sending), MAX_CLAIMS)
        if free <= 0:
            return False
        try:
            due = await self._run_blocking(self._deliveries.claim, LEASE_SECONDS, free)
        except StoreError as error:
            self._outage.fail(error)
            await asyncio.sleep(POLL_SECONDS)
            return False
        self._outage.succeed()
        for each in due:
            task = asyncio.create_task(self._deliver(each))
            self._sending.add(task)
            task.add_done_callback(self._sending.discard)
        return len(due) == MAX_CLAIMS

    async def _deliver(self, due: DueDelivery) -> None:
        began = monotonic()
        status, error = await self._send(due)
        try:
            finished = await self._run_blocking(self._deliveries.record, due, status, error)
        except StoreError as failure:
            # The lease expires, and the delivery is repeated.
            log.warning("delivery not recorded", delivery=due.id, reason=str(failure))
            return
        outcome = "delivered" if error is None else "failed" if finished else "retried"
        self._observe(outcome, monotonic() - began)
        log.info(
            "delivery", id=due.id, webhook=due.webhook, attempt=due.attempt, outcome=outcome, status=status
        )

    async def _send(self, due: DueDelivery) -> tuple[int | None, str | None]:
        """Send a delivery; return the status of the response, and why the attempt has failed."""
        body = due.body.encode()
        headers = {
            "Content-Type": "application/json",
            **sign_request(due.secret, due.id, int(time()), body),
        }
        try:
            async with self._client.open("POST", due.url, REQUEST_SECONDS, headers, body) as response:
                return response.status_code, _explain_status(response.status_code)
        except (OutboundRefusedError, OutboundFailedError) as error:
            return None, str(error)
        except Exception:
            log.exception("delivery failed with a defect", delivery=due.id)
            return None, "the service failed with an unexpected error, which is in its log"


def sign_request(secret: str, delivery: str, timestamp: int, body: bytes) -> dict[str, str]:
    """Return the headers of a signed request, after Standard Webhooks 1.0 (www.standardwebhooks.com).

    Parameters
    ----------
    secret : str
        ``whsec_`` and the key in Base64.
    delivery : str
        Id of the delivery, by which the receiver detects a repetition.
    timestamp : int
        Time of the attempt in seconds since 1970.
    body : bytes
        Content of the request, unchanged.
    """
    key = base64.b64decode(secret.partition("_")[2], validate=True)
    signed = f"{delivery}.{timestamp}.".encode() + body
    signature = base64.b64encode(hmac.new(key, signed, hashlib.sha256).digest()).decode()
    return {
        "webhook-id": delivery,
        "webhook-timestamp": str(timestamp),
        "webhook-signature": f"v1,{signature}",
    }


def _explain_status(status: int) -> str | None:
    if 200 <= status < 300:
        return None
    return f"the response has the status {status}, and one from 200 to 299 is needed"
