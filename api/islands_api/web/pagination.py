"""Cursors: where the next page begins, as text that a client hands back as it is."""

import base64
import binascii
import json
import re
from math import isfinite
from typing import Annotated

from fastapi import Query

from islands.errors import SettingsError

#: What a route that lists asks for.
Cursor = Annotated[str | None, Query(max_length=200, description="`next` of the page before.")]
Limit = Annotated[int, Query(ge=1, le=200, description="The most entries of a page.")]


def encode_cursor(place: tuple[float, str] | None) -> str | None:
    """Write the place behind which the next page begins."""
    if place is None:
        return None
    return base64.urlsafe_b64encode(json.dumps(place).encode()).decode().rstrip("=")


def decode_cursor(cursor: str | None) -> tuple[float, str] | None:
    """Read a cursor.

    Raises
    ------
    SettingsError
        It is none of ours.
    """
    if cursor is None:
        return None
    try:
        created, identity = json.loads(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)))
        if not (isfinite(float(created)) and re.fullmatch(r"[\w-]{1,64}", identity, re.ASCII)):
            raise ValueError(cursor)
        return float(created), identity
    except (ValueError, TypeError, OverflowError, binascii.Error):
        raise SettingsError(f"{cursor!r} is no cursor: give `next` of the page before as it is") from None
