"""Verification of bearer tokens (JWT, RFC 7519 and 8725), and the owner and scopes that they give.

The public keys of the issuer are read from its discovery document, cached, and kept during an outage.
"""

import asyncio
import hashlib
import json
import re
from collections.abc import Callable, Mapping
from math import inf, isfinite
from time import monotonic, time
from typing import Any

import structlog
from joserfc import jwt
from joserfc.errors import JoseError
from joserfc.jwk import JWKRegistry
from joserfc.jws import JWSRegistry

from islands.errors import SettingsError
from islands_api.bearer_token import (
    MAX_TOKEN,
    ROLES,
    IssuerUnavailableError,
    TokenIdentity,
    TokenRefusedError,
    read_header,
)
from islands_service.logs import OutageLog
from islands_service.outbound import CheckedClient, OutboundFailedError, OutboundRefusedError, read_body
from islands_service.settings import ServiceSettings, split_list

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

#: Algorithms of signatures that may be allowed. All are asymmetric.
ALGORITHMS = (
    "RS256",
    "RS384",
    "RS512",
    "PS256",
    "PS384",
    "PS512",
    "ES256",
    "ES384",
    "ES512",
    "Ed25519",
)

#: Types of tokens: none, an ID token, or an access token (RFC 9068). Others have another purpose.
_TYPES = (None, "jwt", "at+jwt", "application/at+jwt")

#: Value of a claim that can be part of the name of an owner.
_PLAIN_OWNER = re.compile(r"[A-Za-z0-9._@|:+=-]{1,48}")

#: Largest number of characters of an untrusted value in a message.
_MAX_QUOTED = 80


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


class TokenVerifier:
    """Verifies the tokens of one issuer.

    Parameters
    ----------
    settings : ServiceSettings
        With an issuer.
    keys : IssuerKeys
    clock : callable
        Returns the seconds since 1970.

    Raises
    ------
    SettingsError
        The audience is missing, an algorithm is not asymmetric, or a role is unknown.
    """

    def __init__(
        self, settings: ServiceSettings, keys: IssuerKeys, clock: Callable[[], float] = time
    ) -> None:
        if not settings.oidc_audience:
            raise SettingsError(
                "ISLANDS_OIDC_ISSUER needs ISLANDS_OIDC_AUDIENCE: without it tokens for other services would "
                "be accepted"
            )
        self._settings, self.keys, self._clock = settings, keys, clock
        self._algorithms = _parse_algorithms(settings.oidc_algorithms)
        self._roles = _parse_roles(settings.oidc_roles)
        # Unknown header parameters are ignored, as the standard demands, unless `crit` names them.
        self._registry = JWSRegistry(algorithms=self._algorithms, strict_check_header=False)

    async def verify(self, token: str) -> TokenIdentity:
        """Return the identity of the bearer of a token.

        Raises
        ------
        TokenRefusedError
            The message names the reason.
        IssuerUnavailableError
            The key of the token is unknown, and the issuer does not answer.
        """
        header = read_header(token)
        if header is None or len(token) > MAX_TOKEN:
            raise TokenRefusedError(f"the token is malformed, or has more than {MAX_TOKEN} characters")
        key = await self._find_key(header)
        try:
            claims = jwt.decode(token, key, registry=self._registry).claims
        except (JoseError, ValueError, TypeError, RecursionError) as error:
            raise TokenRefusedError("the signature of the token is not valid: request a new one") from error
        self._check_claims(claims)
        return self._identify(claims)

    async def _find_key(self, header: Mapping[str, Any]) -> Any:
        """Return the key that a header names, after all checks that need no key."""
        algorithm, identity, kind = header.get("alg"), header.get("kid"), header.get("typ")
        if algorithm not in self._algorithms:
            raise TokenRefusedError(
                f"the token is signed with {_quote(algorithm)}, and the service accepts "
                f"{', '.join(self._algorithms)}"
            )
        if (kind.lower() if isinstance(kind, str) else kind) not in _TYPES:
            raise TokenRefusedError(
                f"the token has the type {_quote(kind)}: send an access token or an ID token"
            )
        if not isinstance(identity, str) or not identity:
            raise TokenRefusedError("the token does not name its key: its header needs a kid")
        key = await self.keys.find(identity)
        if key is None:
            raise TokenRefusedError(
                f"the key {_quote(identity)} of the token is not one of the issuer: request a new token"
            )
        if key.get("alg") not in (None, algorithm):
            raise TokenRefusedError(f"the key {_quote(identity)} is not for {algorithm}: request a new token")
        return key

    def _check_claims(self, claims: Mapping[str, Any]) -> None:
        settings, now = self._settings, self._clock()
        if claims.get("iss") != settings.oidc_issuer:
            raise TokenRefusedError(
                f"the token was issued by {_quote(claims.get('iss'))}, and the service accepts only "
                f"{settings.oidc_issuer}"
            )
        audience = claims.get("aud")
        if settings.oidc_audience not in (audience if isinstance(audience, list) else [audience]):
            raise TokenRefusedError(
                f"the token is for {_quote(audience)}: request one for the audience {settings.oidc_audience}"
            )
        expires = _read_time(claims, "exp")
        if expires is None:
            raise TokenRefusedError("the token does not expire: it needs the claim exp")
        if now >= expires + settings.oidc_leeway:
            raise TokenRefusedError("the token has expired: request a new one")
        for name in ("nbf", "iat"):
            begins = _read_time(claims, name)
            if begins is not None and now < begins - settings.oidc_leeway:
                raise TokenRefusedError(f"the token is not valid yet (claim {name}): check the clocks")

    def _identify(self, claims: Mapping[str, Any]) -> TokenIdentity:
        owner = _find_claim(claims, self._settings.oidc_owner_claim)
        if not isinstance(owner, str) or not owner:
            raise TokenRefusedError(
                "the token does not name an owner: it needs the claim "
                f"{self._settings.oidc_owner_claim} as text"
            )
        subject = claims.get("sub")
        scopes: set[str] = set()
        for role in self._find_roles(claims):
            scopes |= ROLES[role]
        return TokenIdentity(
            make_owner_name(self._settings.oidc_issuer, owner),
            f"sub-{_digest(subject if isinstance(subject, str) else owner)[:12]}",
            frozenset(scopes),
            float(claims["exp"]) + self._settings.oidc_leeway,
        )

    def _find_roles(self, claims: Mapping[str, Any]) -> set[str]:
        """Return the roles for the values of the claim: a list, or a text with spaces like ``scope``."""
        given = _find_claim(claims, self._settings.oidc_role_claim)
        values = given.split() if isinstance(given, str) else given if isinstance(given, list) else []
        return {self._roles[value] for value in values if isinstance(value, str) and value in self._roles}


def make_owner_name(issuer: str, value: str) -> str:
    """Return the name of the owner of a claim's value: ``oidc-``, a digest of the issuer, and the value.

    No value gives the name of an owner of another issuer. A value that is too long, or has characters that a
    path cannot have, is replaced by its digest.
    """
    plain = value if _PLAIN_OWNER.fullmatch(value) else f"~{_digest(value)[:47]}"
    return f"oidc-{_digest(issuer)[:8]}:{plain}"


def make_token_verifier(settings: ServiceSettings) -> TokenVerifier | None:
    """Return the verifier of the settings; None without an issuer.

    The host of the issuer may have a private address, since the operator has named it.

    Raises
    ------
    SettingsError
        See `TokenVerifier`, or the URL of the issuer cannot be used.
    """
    issuer = settings.oidc_issuer
    if not issuer:
        return None
    private, plain = split_list(settings.private_hosts), split_list(settings.http_hosts)
    host = CheckedClient(private, plain).check_url(issuer).netloc.decode("ascii").lower()
    return TokenVerifier(settings, IssuerKeys(issuer, CheckedClient((*private, host), plain)))


def _parse_algorithms(text: str) -> tuple[str, ...]:
    algorithms = split_list(text)
    if not algorithms or not set(algorithms) <= set(ALGORITHMS):
        raise SettingsError(
            f"ISLANDS_OIDC_ALGORITHMS: {text or '(none)'} has an unknown or symmetric algorithm: take some "
            f"of {', '.join(ALGORITHMS)}"
        )
    return algorithms


def _parse_roles(text: str) -> dict[str, str]:
    roles = {}
    for entry in split_list(text):
        value, _, role = (part.strip() for part in entry.rpartition("="))
        if not value or role not in ROLES:
            raise SettingsError(
                f"ISLANDS_OIDC_ROLES: {entry!r} is not VALUE=ROLE with a role of {', '.join(ROLES)}"
            )
        roles[value] = role
    return roles


def _read_time(claims: Mapping[str, Any], name: str) -> float | None:
    value = claims.get(name)
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
        raise TokenRefusedError(f"the claim {name} of the token is not a time in seconds")
    return float(value)


def _find_claim(claims: Mapping[str, Any], name: str) -> Any:
    """Return a claim by its name, which may contain dots, or else by its path: ``realm_access.roles``."""
    if name in claims:
        return claims[name]
    value: Any = claims
    for part in name.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return value


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _quote(value: Any) -> str:
    return repr(value)[:_MAX_QUOTED]
