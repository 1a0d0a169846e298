"""Public keys of the token issuer: read from its discovery document, cached, and kept during an outage."""

import asyncio
import json
from collections.abc import Callable
from math import inf
from time import monotonic
from typing import Any

import structlog
from joserfc.errors import JoseError
from joserfc.jwk import JWKRegistry

from islands_api.oidc.bearer_token import IssuerUnavailableError
from islands_service.logs import OutageLog
from islands_service.outbound.addresses import OutboundFailedError, OutboundRefusedError
from islands_service.outbound.checked_client import CheckedClient, read_body

log = structlog.get_logger()

#: Seconds after which the keys are read again, while they remain in use.
REFRESH_SECONDS = 600.0

#: Least time in seconds between two attempts to read the keys, whatever tokens arrive.
MIN_INTERVAL = 5.0

#: Seconds for which the keys are used if the issuer does not answer.
KEEP_SECONDS = 6 * 3600.0

#: Time limit of one request to the issuer in seconds.
_REQUEST_SECONDS = 10.0

#: Largest size of a document of the issuer in bytes.
_MAX_DOCUMENT = 500_000

#: Types of asymmetric keys.
_KEY_TYPES = ("RSA", "EC", "OKP")

_MIN_RSA_BITS = 2048


class IssuerKeys:
    """Cache of the public keys of an issuer by their ids. It belongs to one event loop.

    Parameters
    ----------
    issuer : str
        Its URL.
    client : CheckedClient
        Client that may send requests to the issuer.
    clock : callable
        Returns seconds.
    """

    def __init__(self, issuer: str, client: CheckedClient, clock: Callable[[], float] = monotonic) -> None:
        self._issuer, self._client, self._clock = issuer, client, clock
        self._keys: dict[str, Any] = {}
        self._read_at = self._tried_at = -inf
        self._failure = ""
        self._reading: asyncio.Task[None] | None = None
        self._outage = OutageLog("keys of the issuer not read", "the issuer answers again", clock)

    async def find(self, identity: str) -> Any:
        """Return the key with an id; None if the issuer has no such key.

        Keys that are `REFRESH_SECONDS` old are read again without a wait. An unknown id waits for this.

        Raises
        ------
        IssuerUnavailableError
            The id is unknown, and the issuer does not answer.
        """
        if self._clock() - self._read_at >= KEEP_SECONDS:
            self._keys = {}
        if identity in self._keys:
            if self._clock() - self._read_at >= REFRESH_SECONDS:
                self._start_reading()
            return self._keys[identity]
        reading = self._start_reading()
        if reading is not None:
            # A client that leaves does not interrupt what others wait for.
            await asyncio.shield(reading)
        if identity not in self._keys and self._failure:
            raise IssuerUnavailableError(
                f"the token cannot be checked, because its issuer {self._issuer} does not answer: try again "
                "later"
            )
        return self._keys.get(identity)

    async def close(self) -> None:
        """Interrupt a request to the issuer."""
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.gather(self._reading, return_exceptions=True)

    def _start_reading(self) -> "asyncio.Task[None] | None":
        """Return the task that reads the keys; None if the last attempt was a moment ago."""
        if self._reading is not None and not self._reading.done():
            return self._reading
        if self._clock() - self._tried_at < MIN_INTERVAL:
            return None
        self._tried_at = self._clock()
        self._reading = asyncio.create_task(self._read())
        return self._reading

    async def _read(self) -> None:
        try:
            discovered = await self._get(f"{self._issuer.rstrip('/')}/.well-known/openid-configuration")
            if discovered.get("issuer") != self._issuer:
                raise ValueError(f"its discovery document names the issuer {discovered.get('issuer')!r}")
            document = await self._get(str(discovered.get("jwks_uri")))
            keys = _import_keys(document.get("keys"))
        except (OutboundRefusedError, OutboundFailedError, ValueError, RecursionError) as error:
            self._failure = str(error)
            self._outage.fail(error, issuer=self._issuer)
            return
        self._outage.succeed(issuer=self._issuer)
        self._keys, self._read_at, self._failure = keys, self._clock(), ""
        log.info("keys of the issuer read", issuer=self._issuer, keys=len(keys))

    async def _get(self, url: str) -> dict[str, Any]:
        async with self._client.open("GET", url, _REQUEST_SECONDS) as response:
            if response.status_code != 200:
                raise OutboundFailedError(f"{url} has the status {response.status_code}")
            document = json.loads(await read_body(response, _MAX_DOCUMENT))
        if not isinstance(document, dict):
            raise ValueError(f"{url} is not a JSON object")
        return document


def _import_keys(documents: Any) -> dict[str, Any]:
    """Return the usable public keys by their ids; others of the set, for example for encryption, are skipped.

    Raises
    ------
    ValueError
        There is no usable key.
    """
    keys: dict[str, Any] = {}
    for document in documents if isinstance(documents, list) else ():
        if (
            not isinstance(document, dict)
            or document.get("kty") not in _KEY_TYPES
            or document.get("use", "sig") != "sig"
            or not isinstance(document.get("kid"), str)
        ):
            continue
        try:
            # A character has six bits.
            if document["kty"] == "RSA" and 6 * len(document["n"]) < _MIN_RSA_BITS:
                raise ValueError(f"it has less than {_MIN_RSA_BITS} bits")
            keys[document["kid"]] = JWKRegistry.import_key(document)
        except (JoseError, ValueError, TypeError, KeyError) as error:
            log.warning("key of the issuer skipped", key=document["kid"], reason=str(error))
    if not keys:
        raise ValueError("its key set has no public key for signatures with an id")
    return keys
