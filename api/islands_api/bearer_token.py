"""Bearer tokens: their roles, their errors, and the identity that a valid one gives. Without cryptography."""

import base64
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from islands.errors import IslandsError

#: Scopes of each role.
ROLES: Mapping[str, frozenset[str]] = {
    "reader": frozenset({"read"}),
    "submitter": frozenset({"read", "write"}),
    "monitor": frozenset({"metrics"}),
    "administrator": frozenset({"read", "write", "metrics", "admin"}),
}

#: Largest number of characters of a token.
MAX_TOKEN = 16_384

_COMPACT = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]*)+")


class TokenRefusedError(IslandsError):
    """The bearer token is not valid."""


@dataclass(frozen=True, slots=True)
class TokenIdentity:
    """What a valid token says about its bearer.

    Attributes
    ----------
    owner : str
        Owner of the jobs and data sets, unique among the issuers.
    subject : str
        Digest of the subject for the audit trail: 16 characters.
    scopes : frozenset of str
        Scopes of all roles.
    expires : float
        Seconds since 1970.
    """

    owner: str
    subject: str
    scopes: frozenset[str]
    expires: float


class IssuerUnavailableError(IslandsError):
    """The token cannot be checked, because its issuer does not answer."""


def is_token(credential: str) -> bool:
    """Return whether a credential has the form of a token: parts with dots, of which the first is JSON."""
    return read_header(credential) is not None


def read_header(token: str) -> dict[str, Any] | None:
    """Return the header of a token, which nothing vouches for; None if the text is no token."""
    if not _COMPACT.fullmatch(token):
        return None
    part = token.partition(".")[0]
    try:
        header = json.loads(base64.urlsafe_b64decode(part + "=" * (-len(part) % 4)))
    except (ValueError, RecursionError):
        return None
    return header if isinstance(header, dict) else None
