"""Authentication: API keys, owners and scopes."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from time import monotonic
from typing import Annotated, Any

from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from islands_api.web.dependencies import AppState
from islands_api.web.problems import AuthenticationError, InsufficientScopeError
from islands_service.domain.job import Requester
from islands_service.store.database import StoreError
from islands_service.store.tenants.keys import SCOPES, Key

#: Owner of all data of requests without a key, which only a loopback address allows.
LOCAL_OWNER = "local"

#: Seconds for which a key is cached, and therefore the longest time for which a revoked key still works.
KEY_CACHE_SECONDS = 1.0

#: Tokens of the rate limit that an invalid key costs the address that sent it.
_INVALID_KEY_TOKENS = 10.0

_bearer = HTTPBearer(auto_error=False, description="A key of `islands keys create`.", scheme_name="key")


@dataclass(frozen=True, slots=True)
class Principal:
    """Authenticated caller.

    Attributes
    ----------
    owner : str
        Owner of the caller's jobs and data sets.
    scopes : frozenset of str
        Scopes of the key.
    requester : Requester
        Key and address, for the audit trail.
    secret : str or None
        Secret of the key. None if the request had no key.
    """

    owner: str
    scopes: frozenset[str]
    requester: Requester
    secret: str | None = field(default=None, repr=False)


class KeyCache:
    """Cache of recently used keys.

    Parameters
    ----------
    state : AppState
    """

    def __init__(self, state: AppState) -> None:
        self._state = state
        self._cache: dict[str, tuple[float, Key | None]] = {}

    async def find(self, secret: str) -> Key | None:
        """Return the key of a secret, or None if there is none."""
        now = monotonic()
        cached_at, key = self._cache.get(secret, (-KEY_CACHE_SECONDS, None))
        if now - cached_at >= KEY_CACHE_SECONDS:
            key = await self._state.run_blocking(self._state.store.keys.find, secret)
            if key is not None:
                self._cache = {
                    cached: entry
                    for cached, entry in self._cache.items()
                    if now - entry[0] < KEY_CACHE_SECONDS
                }
                self._cache[secret] = now, key
        return key

    async def is_still_valid(self, caller: Principal) -> bool:
        """Return whether the key of the caller is still valid. True if the database is unavailable."""
        if caller.secret is None:
            return True
        try:
            key = await self.find(caller.secret)
        except StoreError:
            return True
        return key is not None and key.valid


async def authenticate(request: Request) -> Principal:
    """Return the caller of a request.

    Raises
    ------
    AuthenticationError
        The key is missing, unknown, revoked or expired.
    RateLimitError
        The key, or the address that sent no valid key, has sent too many requests.
    """
    if not hasattr(request.state, "caller"):
        # Only once per request: each check takes a token of the rate limit.
        request.state.caller = await _check_key(request, request.app.state.islands, await _bearer(request))
    caller: Principal = request.state.caller
    return caller


async def _check_key(
    request: Request, state: AppState, credentials: HTTPAuthorizationCredentials | None
) -> Principal:
    address = request.client.host if request.client is not None else "?"
    if credentials is None:
        if state.settings.keys_needed:
            state.rate_limiter.acquire(f"address {address}")
            raise AuthenticationError(
                "this service needs a key: send 'Authorization: Bearer islands_...'; its operator creates "
                "one with 'islands keys create'"
            )
        return Principal(LOCAL_OWNER, frozenset(SCOPES), Requester(address))
    key = await request.app.state.keys.find(credentials.credentials)
    if key is None or not key.valid:
        state.rate_limiter.acquire(f"address {address}", min(_INVALID_KEY_TOKENS, state.settings.burst))
        reason = "is unknown" if key is None else "was revoked" if key.revoked is not None else "has expired"
        raise AuthenticationError(f"the key {reason}: ask the operator of this service for another one")
    state.rate_limiter.acquire(f"key {key.id}")
    return Principal(key.owner, key.scopes, Requester(address, key.id), credentials.credentials)


async def _get_principal(
    request: Request,
    _described: Annotated[HTTPAuthorizationCredentials | None, Security(_bearer)] = None,
) -> Principal:
    return await authenticate(request)


def check_scope(caller: Principal, scope: str) -> None:
    """Refuse a caller without a scope.

    Raises
    ------
    InsufficientScopeError
    """
    if scope not in caller.scopes:
        raise InsufficientScopeError(
            f"the key has the scopes {', '.join(sorted(caller.scopes))}, but this request needs "
            f"{scope}: ask for another key"
        )


def _require_scope(scope: str) -> Callable[[Principal], Awaitable[Principal]]:
    async def check_caller(caller: Annotated[Principal, Depends(_get_principal)]) -> Principal:
        check_scope(caller, scope)
        return caller

    return check_caller


#: Type of a route parameter that receives a caller with the scope `read`.
Reader = Annotated[Principal, Depends(_require_scope("read"))]

#: Type of a route parameter that receives a caller with the scope `write`.
Writer = Annotated[Principal, Depends(_require_scope("write"))]

#: Type of a route parameter that receives a caller with the scope `admin`.
Administrator = Annotated[Principal, Depends(_require_scope("admin"))]

#: Type of a route parameter that receives a caller with the scope `metrics`.
Operator = Annotated[Any, Depends(_require_scope("metrics"))]
