"""Authentication: API keys and tokens, owners and scopes."""

from dataclasses import dataclass, field
from importlib.util import find_spec
from math import inf
from time import monotonic, time
from typing import TYPE_CHECKING, Annotated, Any

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from fastapi.security.base import SecurityBase

from islands.distribution import describe_missing_extra
from islands.errors import SettingsError
from islands_api.bearer_token import TokenRefusedError, is_token
from islands_api.web.dependencies import AppState
from islands_api.web.problems import AuthenticationError, InsufficientScopeError
from islands_service.domain.job import Requester
from islands_service.settings import ServiceSettings
from islands_service.store.database import StoreError
from islands_service.store.keys import SCOPES, Key

if TYPE_CHECKING:
    from islands_api.token_verifier import TokenVerifier

#: Owner of all data of requests without a key, which only a loopback address allows.
LOCAL_OWNER = "local"

#: Seconds for which a key is cached, and therefore the longest time for which a revoked key still works.
KEY_CACHE_SECONDS = 1.0

#: Requests that an invalid key or token counts as in the rate limit of the address that sent it.
_INVALID_KEY_COST = 10.0

_bearer = HTTPBearer(
    auto_error=False,
    description="A key of `islands admin keys`, or a token (JWT) of the identity provider of this service.",
    scheme_name="key",
)


@dataclass(frozen=True, slots=True)
class Principal:
    """Authenticated caller.

    Attributes
    ----------
    owner : str
        Owner of the caller's jobs and data sets.
    scopes : frozenset of str
        Scopes of the key, or of the roles of the token.
    requester : Requester
        Key, or digest of the subject of the token, and address, for the audit trail.
    secret : str or None
        Secret of the key. None if the request had no key.
    expires : float
        Time at which the token expires, in seconds since 1970.
    """

    owner: str
    scopes: frozenset[str]
    requester: Requester
    secret: str | None = field(default=None, repr=False)
    expires: float = inf


class KeyCache:
    """Cache of recently used keys."""

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
        """Return whether the key or token of the caller is still valid, True without the database."""
        if caller.secret is None:
            return time() < caller.expires
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
    TokenRefusedError, IssuerUnavailableError
        The token is not valid, or cannot be checked.
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
                "one with 'islands admin keys'"
                + (f"; or send a token of {state.settings.oidc_issuer}" if state.tokens is not None else "")
            )
        return Principal(LOCAL_OWNER, frozenset(SCOPES), Requester(address))
    if state.tokens is not None and is_token(credentials.credentials):
        return await _check_token(state, state.tokens, credentials.credentials, address)
    key = await request.app.state.keys.find(credentials.credentials)
    if key is None or not key.valid:
        state.rate_limiter.acquire(f"address {address}", min(_INVALID_KEY_COST, state.settings.burst))
        reason = "is unknown" if key is None else "was revoked" if key.revoked is not None else "has expired"
        raise AuthenticationError(f"the key {reason}: ask the operator of this service for another one")
    state.rate_limiter.acquire(f"key {key.id}")
    return Principal(key.owner, key.scopes, Requester(address, key.id), credentials.credentials)


async def _check_token(state: AppState, tokens: "TokenVerifier", token: str, address: str) -> Principal:
    try:
        identity = await tokens.verify(token)
    except TokenRefusedError:
        state.rate_limiter.acquire(f"address {address}", min(_INVALID_KEY_COST, state.settings.burst))
        raise
    state.rate_limiter.acquire(f"token {identity.subject}")
    by = Requester(address, identity.subject)
    return Principal(identity.owner, identity.scopes, by, expires=identity.expires)


def make_verifier(settings: ServiceSettings) -> "TokenVerifier | None":
    """Return the verifier of tokens; None if the settings have no issuer.

    Raises
    ------
    SettingsError
        The settings of tokens contradict each other, or the extra ``oidc`` is not installed.
    """
    if not settings.oidc_issuer:
        return None
    if find_spec("joserfc") is None:
        raise SettingsError(describe_missing_extra("the setting ISLANDS_OIDC_ISSUER", "oidc"))
    # The import of the cryptography takes a tenth of a second.
    from islands_api.token_verifier import make_token_verifier  # noqa: PLC0415

    return make_token_verifier(settings)


def check_scope(caller: Principal, scope: str) -> None:
    """Refuse a caller without a scope.

    Raises
    ------
    InsufficientScopeError
    """
    if scope not in caller.scopes:
        kind, remedy = ("key", "key") if caller.expires == inf else ("token", "role")
        raise InsufficientScopeError(
            f"the {kind} has the scopes {', '.join(sorted(caller.scopes)) or '(none)'}, but this request "
            f"needs {scope}: ask for another {remedy}"
        )


class _ScopedBearer(SecurityBase):
    """Dependency that returns a caller with a scope. It is the security scheme of its routes, too.

    One dependency without others: each costs some per cent of a request.
    """

    def __init__(self, scope: str) -> None:
        self.model, self.scheme_name = _bearer.model, _bearer.scheme_name
        self._scope = scope

    async def __call__(self, request: Request) -> Principal:
        """Authenticate a request, and check the scope."""
        caller = await authenticate(request)
        check_scope(caller, self._scope)
        return caller


#: Type of a route parameter that receives a caller with the scope `read`.
Reader = Annotated[Principal, Depends(_ScopedBearer("read"))]

#: Type of a route parameter that receives a caller with the scope `write`.
Writer = Annotated[Principal, Depends(_ScopedBearer("write"))]

#: Type of a route parameter that receives a caller with the scope `admin`.
Administrator = Annotated[Principal, Depends(_ScopedBearer("admin"))]

#: Type of a route parameter that receives a caller with the scope `metrics`.
Operator = Annotated[Any, Depends(_ScopedBearer("metrics"))]
