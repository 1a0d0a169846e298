"""Bodies of requests: what cannot be read is refused in words of our own, before the framework guesses.

JSON is read strictly: of a name that stands twice the framework would take the last, and NaN for a number.
"""

import base64
import binascii
import json
import re
from collections import Counter
from collections.abc import Callable, Coroutine
from http import HTTPStatus
from math import isfinite
from operator import itemgetter
from typing import Annotated, Any, ClassVar

from fastapi import Query, Request, Response
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

from islands.errors import SettingsError
from islands_api.web.auth import authenticate
from islands_api.web.problems import MalformedBodyError, UnsupportedMediaTypeError

#: The most digits of a whole number: reading one takes the square of their count.
_DIGITS = 400

#: Characters of a name that are repeated to whoever sent it.
_NAME = 40


class BodyRoute(APIRoute):
    """A route that takes bodies of one type alone."""

    media: ClassVar[str]
    advice: ClassVar[str] = "send it anew"

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return what answers a request, behind a look at its body's type."""
        handler = super().get_route_handler()
        if self.body_field is None:
            return handler

        async def handle(request: Request) -> Response:
            # Before the body is received: a stranger would have us keep what nobody will look at.
            await authenticate(request)
            given = request.headers.get("content-type", "")
            if given.partition(";")[0].strip().lower() != self.media:
                raise UnsupportedMediaTypeError(
                    f"the body is {given or 'of no type'}: send it as {self.media}"
                )
            try:
                return await handler(_Strict(request.scope, request.receive))
            except HTTPException as error:
                if error.status_code != HTTPStatus.BAD_REQUEST or isinstance(error, MalformedBodyError):
                    raise
                if isinstance(error.__cause__, OSError):  # a full disk, say
                    raise
                raise MalformedBodyError(
                    f"the body cannot be read ({error.detail}): {self.advice}"
                ) from error

        return handle


class JSONRoute(BodyRoute):
    """A route that takes JSON."""

    media = "application/json"


class FormRoute(BodyRoute):
    """A route that takes a form with a file in it."""

    media = "multipart/form-data"
    advice = "send the record as the part 'file' of a form, under a name of at most 200 characters"


class _Strict(Request):
    async def json(self) -> Any:
        if not hasattr(self, "_json"):
            self._json = read_json(await self.body())
        return self._json


def read_json(body: bytes) -> Any:
    """Read JSON as RFC 8259 has it.

    Raises
    ------
    MalformedBodyError
        It is none, holds what is no number, names a thing twice, or is nested too deeply.
    """
    try:
        return json.loads(body, object_pairs_hook=_once, parse_int=_whole, parse_constant=_no_number)
    except RecursionError:
        raise MalformedBodyError("the body is nested too deeply: a job needs a few levels") from None
    except json.JSONDecodeError as error:
        raise MalformedBodyError(
            f"the body is no JSON: {error.msg} in line {error.lineno}, column {error.colno}"
        ) from error
    except ValueError as error:
        raise MalformedBodyError(f"the body is no JSON: {error}") from error


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    read = dict(pairs)
    if len(read) < len(pairs):
        twice, _ = max(Counter(name for name, _ in pairs).items(), key=itemgetter(1))
        raise ValueError(f"{twice[:_NAME]!r} stands in it twice")
    return read


def _whole(text: str) -> int:
    if len(text) > _DIGITS:
        raise ValueError(f"a number in it has {len(text)} digits")
    return int(text)


def _no_number(text: str) -> Any:
    raise ValueError(f"{text} is no number there: leave the entry out")


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
