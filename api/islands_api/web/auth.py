"""Who asks: the owner behind a key, and what the key allows."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from time import monotonic
from typing import Annotated, Any

from fastapi import Depends, Request, Security
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer

from islands_api.web.dependencies import AppState
from islands_api.web.problems import AuthenticationError, InsufficientScopeError
from islands_service.store.database import StoreError
from islands_service.store.keys import SCOPES, Key

#: Whose everything is that comes without a key, on a loopback address.
LOCAL = "local"

#: Seconds for which a key is not looked up again: so long may a revoked one still open.
REMEMBERED = 1.0

#: Tokens of the rate limit that a wrong key costs its address.
_WRONG = 10.0

_bearer = HTTPBearer(auto_error=False, description="A key of `islands keys create`.", scheme_name="key")


@dataclass(frozen=True, slots=True)
class Principal:
    """Who asks.

    Attributes
    ----------
    owner : str
        Whose jobs and data sets these are.
    scopes : frozenset of str
        What is allowed.
    secret : str or None
        Of the key that was shown.
    """

    owner: str
    scopes: frozenset[str]
    secret: str | None = field(default=None, repr=False)


class KeyCache:
    """Keys that were looked up a moment ago.

    Parameters
    ----------
    state : AppState
    """

    def __init__(self, state: AppState) -> None:
        self._state = state
        self._found: dict[str, tuple[float, Key | None]] = {}

    async def find(self, secret: str) -> Key | None:
        """Return a secret's key, None where it is of none."""
        now = monotonic()
        at, key = self._found.get(secret, (-REMEMBERED, None))
        if now - at >= REMEMBERED:
            key = await self._state.run_blocking(self._state.store.keys.find, secret)
            if key is not None:
                self._found = {
                    each: entry for each, entry in self._found.items() if now - entry[0] < REMEMBERED
                }
                self._found[secret] = now, key
        return key

    async def is_still_valid(self, caller: Principal) -> bool:
        """Tell whether a caller who was let in a while ago would be let in now, as far as can be known."""
        if caller.secret is None:
            return True
        try:
            key = await self.find(caller.secret)
        except StoreError:
            return True
        return key is not None and key.valid


async def authenticate(request: Request) -> Principal:
    """Return who asks.

    Raises
    ------
    AuthenticationError
    RateLimitError
    """
    if not hasattr(request.state, "caller"):
        # Once for each request: it takes a token of the rate.
        request.state.caller = await _let_in(request, request.app.state.islands, await _bearer(request))
    caller: Principal = request.state.caller
    return caller


async def _let_in(request: Request, state: AppState, given: HTTPAuthorizationCredentials | None) -> Principal:
    address = request.client.host if request.client is not None else "?"
    if given is None:
        if state.settings.keys_needed:
            state.rate_limiter.acquire(f"address {address}")
            raise AuthenticationError(
                "this service needs a key: send 'Authorization: Bearer islands_...'; whoever runs it makes "
                "one with 'islands keys create'"
            )
        return Principal(LOCAL, frozenset(SCOPES))
    key = await request.app.state.keys.find(given.credentials)
    if key is None or not key.valid:
        state.rate_limiter.acquire(f"address {address}", min(_WRONG, state.settings.burst))
        what = "is unknown" if key is None else "was revoked" if key.revoked is not None else "has expired"
        raise AuthenticationError(f"the key {what}: ask whoever runs this service for another one")
    state.rate_limiter.acquire(f"key {key.id}")
    return Principal(key.owner, key.scopes, given.credentials)


async def _caller(
    request: Request,
    _described: Annotated[HTTPAuthorizationCredentials | None, Security(_bearer)] = None,
) -> Principal:
    return await authenticate(request)


def _allowed(scope: str) -> Callable[[Principal], Awaitable[Principal]]:
    async def allowed(caller: Annotated[Principal, Depends(_caller)]) -> Principal:
        if scope not in caller.scopes:
            raise InsufficientScopeError(
                f"the key has the scopes {', '.join(sorted(caller.scopes))}, this needs "
                f"{scope}: ask for another key"
            )
        return caller

    return allowed


#: What a route asks for: a caller who may look, who may change, who may see the service's metrics.
Reader = Annotated[Principal, Depends(_allowed("read"))]
Writer = Annotated[Principal, Depends(_allowed("write"))]
Operator = Annotated[Any, Depends(_allowed("metrics"))]
