"""Request bodies and cursors: strict parsing with clear errors, before the framework parses leniently.

The JSON parser of the framework keeps the last value of a duplicate name and accepts NaN as a number.
"""

import base64
import binascii
import json
import re
from collections import Counter
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from http import HTTPStatus
from math import isfinite
from operator import itemgetter
from typing import Annotated, Any, ClassVar

from fastapi import Header, Query, Request, Response
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute
from pydantic import BaseModel
from starlette.exceptions import HTTPException
from starlette.types import Receive, Scope

from islands.errors import IslandsError, SettingsError
from islands_api.web.auth import Principal, authenticate, check_scope
from islands_api.web.middleware import FORM_OVERHEAD_BYTES
from islands_api.web.parameter_names import check_names
from islands_api.web.problems import MalformedBodyError, PayloadTooLargeError, UnsupportedMediaTypeError
from islands_api.web.uploads.body_reader import BodyReader
from islands_api.web.uploads.request import UploadRequest

#: Maximum number of digits of an integer: parsing takes time proportional to the square of the digits.
_MAX_INTEGER_DIGITS = 400

#: Maximum numbers of names, of array elements and of nested levels of a body. Validation holds the event loop
#: for some microseconds for each name or element that is wrong.
_MAX_NAMES, _MAX_ELEMENTS, _MAX_DEPTH = 3000, 5000, 64

#: Size in bytes from which a body is parsed in a thread.
_LARGE_BODY = 20_000

#: Maximum number of characters of a name that an error message repeats.
_MAX_QUOTED_NAME = 40


class StrictRoute(APIRoute):
    """Route that refuses unknown query parameters, which the framework ignores."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return a handler that checks the names of the query parameters first."""
        handler = super().get_route_handler()
        known = _list_query_parameters(self.dependant)

        async def handle(request: Request) -> Response:
            check_names(request.query_params, known, "query parameter", self.path)
            return await handler(request)

        return handle


def _list_query_parameters(dependant: Dependant) -> tuple[str, ...]:
    """Return the query parameters of a route and of its dependencies."""
    own = [parameter.alias for parameter in dependant.query_params]
    return (*own, *(name for each in dependant.dependencies for name in _list_query_parameters(each)))


class BodyRoute(StrictRoute):
    """Route that accepts bodies of one media type."""

    media: ClassVar[str]
    advice: ClassVar[str] = "send it again"

    #: Largest number of array elements of a body in JSON.
    max_elements: ClassVar[int] = _MAX_ELEMENTS

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return a handler that checks the caller and the media type before it reads the body."""
        handler = super().get_route_handler()
        if self.body_field is None:
            return handler

        async def handle(request: Request) -> Response:
            # Authenticate before reading the body, so that anonymous clients cannot make the server
            # buffer data.
            caller = await authenticate(request)
            media = request.headers.get("content-type", "")
            if media.partition(";")[0].strip().lower() != self.media:
                raise UnsupportedMediaTypeError(
                    f"the body has {f'the type {media}' if media else 'no type'}: send it as {self.media}"
                )
            try:
                async with self.receiving(request, caller) as received:
                    return await handler(received)
            except HTTPException as error:
                if isinstance(error.__cause__, IslandsError):  # raised while the framework read the body
                    raise error.__cause__ from None
                if error.status_code != HTTPStatus.BAD_REQUEST or isinstance(error, MalformedBodyError):
                    raise
                if isinstance(error.__cause__, OSError):  # for example a full disk
                    raise
                raise MalformedBodyError(
                    f"the body cannot be read ({error.detail}): {self.advice}"
                ) from error

        return handle

    @asynccontextmanager
    async def receiving(self, request: Request, caller: Principal) -> AsyncIterator[Request]:  # noqa: ARG002
        """Return the request with limits on its body."""
        settings = request.app.state.islands.settings
        body = BodyReader(request.receive, settings.body_timeout, settings.body_rate)
        yield _StrictRequest(request.scope, body.receive, self.max_elements)


class JSONRoute(BodyRoute):
    """Route that accepts JSON."""

    media = "application/json"


class FormRoute(BodyRoute):
    """Route that accepts a form with a file."""

    media = "multipart/form-data"
    advice = "send the record as the part 'file' of a form, under a name of at most 200 characters"

    @asynccontextmanager
    async def receiving(self, request: Request, caller: Principal) -> AsyncIterator[Request]:
        """Return the request with limits on its body, after all checks that are possible without the body.

        Raises
        ------
        InsufficientScopeError, UploadLimitError, QuotaError, StorageFullError
        """
        check_scope(caller, "write")
        state = request.app.state.islands
        settings = state.settings
        length = request.headers.get("content-length", "")
        least = max(0, int(length) - FORM_OVERHEAD_BYTES) if length.isdecimal() else 0
        most = least if length else settings.max_upload
        quotas = await state.quotas(caller.owner)
        with state.uploads.admit(caller.owner, quotas.max_uploads):
            stored = await state.run_blocking(state.store.datasets.stored_bytes, caller.owner)
            with (
                state.uploads.reserve(caller.owner, least, most, stored, quotas.max_stored) as reserved,
                await state.run_blocking(state.blobs.spool) as target,
            ):
                room = reserved + FORM_OVERHEAD_BYTES
                body = BodyReader(request.receive, settings.body_timeout, settings.body_rate, room)
                fields = [field.alias for field in self.dependant.body_params]
                yield UploadRequest(request.scope, body.receive, target, fields, self.path)


def describe_upload(view: type[BaseModel], noun: str) -> dict[int | str, dict[str, Any]]:
    """Return the OpenAPI descriptions of the answers to an upload.

    Parameters
    ----------
    view : type
        Model of the answer.
    noun : str
        What is uploaded, as ``data set``.
    """
    headers = {"Location": {"description": f"Path of the {noun}.", "schema": {"type": "string"}}}
    again = {"model": view, "description": "The same bytes were uploaded before.", "headers": headers}
    return {200: again, 201: {"description": "Stored.", "headers": headers}}


class _StrictRequest(Request):
    def __init__(self, scope: Scope, receive: Receive, max_elements: int) -> None:
        super().__init__(scope, receive)
        self._max_elements = max_elements

    async def json(self) -> Any:
        if not hasattr(self, "_json"):
            body = await self.body()
            if len(body) < _LARGE_BODY:
                self._json = read_json(body, self._max_elements)
            else:
                self._json = await self.app.state.islands.run_blocking(read_json, body, self._max_elements)
        return self._json


def read_json(body: bytes, max_elements: int = _MAX_ELEMENTS) -> Any:
    """Parse JSON strictly according to RFC 8259.

    Parameters
    ----------
    body : bytes
    max_elements : int
        Largest number of array elements.

    Raises
    ------
    MalformedBodyError
        The body is not JSON, contains NaN, infinity or a huge integer, repeats a name, or is nested too
        deeply.
    PayloadTooLargeError
        The body has too many names or array elements.
    """
    document = _parse_json(body)
    _check_extent(document, max_elements)
    return document


def _parse_json(body: bytes) -> Any:
    try:
        return json.loads(
            body,
            object_pairs_hook=_reject_duplicates,
            parse_int=_parse_integer,
            parse_constant=_reject_constant,
        )
    except RecursionError:
        raise _make_depth_error() from None
    except json.JSONDecodeError as error:
        raise MalformedBodyError(
            f"the body is not valid JSON: {error.msg} in line {error.lineno}, column {error.colno}"
        ) from error
    except ValueError as error:
        raise MalformedBodyError(f"the body is not valid JSON: {error}") from error


def _check_extent(document: Any, max_elements: int) -> None:
    """Refuse a document whose validation would take long."""
    names = elements = 0
    level, depth = [document], 0
    while level := [each for each in level if isinstance(each, dict | list)]:
        depth += 1
        if depth > _MAX_DEPTH:
            raise _make_depth_error()
        names += sum(len(each) for each in level if isinstance(each, dict))
        elements += sum(len(each) for each in level if isinstance(each, list))
        for count, most, what in ((names, _MAX_NAMES, "names"), (elements, max_elements, "array elements")):
            if count > most:
                raise PayloadTooLargeError(
                    f"the body has {count} {what} or more, and {most} is the most: send only the documented "
                    "fields, and upload data as a data set"
                )
        level = [value for each in level for value in (each.values() if isinstance(each, dict) else each)]


def _make_depth_error() -> MalformedBodyError:
    return MalformedBodyError("the body is nested too deeply: a job needs only a few levels")


def _reject_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    document = dict(pairs)
    if len(document) < len(pairs):
        duplicate, _ = max(Counter(name for name, _ in pairs).items(), key=itemgetter(1))
        raise ValueError(f"the name {duplicate[:_MAX_QUOTED_NAME]!r} appears twice")
    return document


def _parse_integer(text: str) -> int:
    if len(text) > _MAX_INTEGER_DIGITS:
        raise ValueError(f"a number has {len(text)} digits")
    return int(text)


def _reject_constant(text: str) -> Any:
    raise ValueError(f"{text} is not a JSON number: omit the entry")


#: Query parameter of a route that lists: the page to return.
Cursor = Annotated[str | None, Query(max_length=200, description="`next` of the previous page.")]

#: Query parameter of a route that lists: the size of the page.
Limit = Annotated[int, Query(ge=1, le=200, description="Maximum number of entries of a page.")]

#: Largest number of a row in a request.
_MAX_ROW = 2**53

#: Query parameters of a route that returns signals for a plot: the rows, and the largest number of parts.
StartRow = Annotated[int, Query(ge=0, le=_MAX_ROW, description="First row, from 0.")]
StopRow = Annotated[
    int | None, Query(ge=1, le=_MAX_ROW, description="Row after the last one; by default the end.")
]
Points = Annotated[int, Query(ge=1, le=5000, description="Most values of a column.")]

#: Header of a route whose response has an entity tag.
IfNoneMatch = Annotated[str | None, Header(max_length=1000, description="The `ETag` of the last response.")]

#: `Cache-Control` of a response with an entity tag: a cache has to ask whether it is still valid.
REVALIDATE = "private, no-cache"


def matches_etag(if_none_match: str | None, tag: str) -> bool:
    """Return whether If-None-Match contains an entity tag; it may list several tags, and weak ones."""
    tags = [each.strip().removeprefix("W/") for each in (if_none_match or "").split(",")]
    return "*" in tags or tag in tags


def encode_cursor(position: tuple[float, str] | None) -> str | None:
    """Encode the creation time and id of the last entry of a page."""
    if position is None:
        return None
    return base64.urlsafe_b64encode(json.dumps(position).encode()).decode().rstrip("=")


def decode_cursor(cursor: str | None) -> tuple[float, str] | None:
    """Decode a cursor to a creation time and an id.

    Raises
    ------
    SettingsError
        The cursor was not made by `encode_cursor`.
    """
    if cursor is None:
        return None
    try:
        created, identity = json.loads(base64.urlsafe_b64decode(cursor + "=" * (-len(cursor) % 4)))
        if not (isfinite(float(created)) and re.fullmatch(r"[\w-]{1,64}", identity, re.ASCII)):
            raise ValueError(cursor)
        return float(created), identity
    except (ValueError, TypeError, OverflowError, binascii.Error):
        raise SettingsError(
            f"{cursor!r} is not a cursor: send `next` of the previous page unchanged"
        ) from None
