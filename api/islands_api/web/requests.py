"""Request bodies and cursors: strict parsing with clear errors, before the framework parses leniently.

The JSON parser of the framework keeps the last value of a duplicate name and accepts NaN as a number.
"""

import asyncio
import base64
import binascii
import json
import re
from collections import Counter
from collections.abc import AsyncIterator, Callable, Collection, Coroutine, Iterable
from contextlib import asynccontextmanager
from dataclasses import fields
from http import HTTPStatus
from math import isfinite
from operator import itemgetter
from time import monotonic
from typing import IO, Annotated, Any, BinaryIO, ClassVar, cast

from fastapi import Header, Query, Request, Response
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute
from pydantic import BaseModel
from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.types import Message, Receive, Scope

from islands.errors import IslandsError, SettingsError, suggest
from islands.records.reading.options import ReadingOptions
from islands_api.web.auth import Principal, authenticate, check_scope
from islands_api.web.middleware import FORM_OVERHEAD_BYTES
from islands_api.web.problems import (
    MalformedBodyError,
    PayloadTooLargeError,
    RequestTimeoutError,
    UnsupportedMediaTypeError,
)
from islands_service.domain.job import QuotaError

#: Options of reading a record, which the form field ``reading`` contains.
_READING = frozenset(option.name for option in fields(ReadingOptions))

#: Maximum number of digits of an integer: parsing takes time proportional to the square of the digits.
_MAX_INTEGER_DIGITS = 400

#: Maximum numbers of names, of array elements and of nested levels of a body. Validation holds the event loop
#: for some microseconds for each name or element that is wrong.
_MAX_NAMES, _MAX_ELEMENTS, _MAX_DEPTH = 3000, 5000, 64

#: Size in bytes from which a body is parsed in a thread.
_LARGE_BODY = 20_000

#: Maximum number of characters of a name that an error message repeats.
_MAX_QUOTED_NAME = 40


def check_names(given: Iterable[str], known: Collection[str], kind: str, path: str) -> None:
    """Refuse an unknown name.

    Parameters
    ----------
    given, known : collection of str
        Names of a request and of its route.
    kind : str
        ``query parameter`` or ``form field``.
    path : str
        Path of the route.

    Raises
    ------
    SettingsError
        A name is unknown. The message lists the known ones.
    """
    for name in given:
        if name not in known:
            listed = f"its {kind}s are {', '.join(known)}" if known else f"it has no {kind}s"
            advice = suggest(name, known)
            if path == "/v1/datasets" and name in _READING:
                advice = (
                    f"; {name} is an option of reading: send it in the form field reading, a JSON object, as "
                    'reading={"header": false}'
                )
            raise SettingsError(f"{path} has no {kind} {name[:_MAX_QUOTED_NAME]!r}; {listed}{advice}")


class BodyReader:
    """Reader that ends a body that stalls, is too slow or exceeds the owner's quota.

    Parameters
    ----------
    receive : Receive
    timeout : float
        Longest time in seconds without a byte.
    rate : float
        Least mean rate in bytes per second, after the first ``timeout`` seconds; 0 for none. Only the time in
        which the service waits for the client counts.
    room : int, optional
        Maximum number of bytes.
    """

    def __init__(self, receive: Receive, timeout: float, rate: float, room: int | None = None) -> None:
        self._receive, self._timeout, self._rate, self._room = receive, timeout, rate, room
        self._received, self._waited, self._complete = 0, 0.0, False

    async def receive(self) -> Message:
        """Receive the next message.

        Raises
        ------
        RequestTimeoutError
            No byte arrived in time, or the body is too slow.
        QuotaError
            The body is longer than the owner's quota allows.
        """
        if self._complete:
            return await self._receive()
        patience = self._timeout
        if self._rate:
            patience = min(patience, self._timeout + self._received / self._rate - self._waited)
        start = monotonic()
        try:
            async with asyncio.timeout(max(patience, 0.0)):
                message = await self._receive()
        except TimeoutError:
            self._waited += monotonic() - start
            raise RequestTimeoutError(
                f"{self._received / 1e6:.3g} MB of the body arrived in {self._waited:.3g} s, but the service "
                f"needs some bytes every {self._timeout:g} s and {self._rate:g} bytes per second: use a "
                "faster connection, or compress the file (.gz)"
            ) from None
        self._waited += monotonic() - start
        self._received += len(message.get("body", b""))
        self._complete = not message.get("more_body", False)
        if self._room is not None and self._received > self._room:
            raise QuotaError("the data sets would take more bytes than their owner may store: delete some")
        return message


class UploadRequest(Request):
    """Request with a form.

    Parameters
    ----------
    scope, receive
        See ASGI.
    target : file object
        Empty file on the disk that receives the single file of the form.
    fields : collection of str
        Names of the fields of the form.
    path : str
        Path of the route, for messages.
    """

    def __init__(
        self, scope: Scope, receive: Receive, target: IO[bytes], fields: Collection[str], path: str
    ) -> None:
        super().__init__(scope, receive)
        self._target, self._fields, self._path = target, fields, path

    async def form(self, **limits: Any) -> FormData:  # type: ignore[override]
        """Parse the form; the limits are those of the framework.

        Raises
        ------
        HTTPException
            The form is malformed.
        SettingsError
            A field is unknown.
        """
        if self._form is None:
            parser = _FileParser(self.headers, self.stream(), **limits)
            parser.target = self._target
            try:
                self._form = await parser.parse()
            except MultiPartException as error:
                raise HTTPException(HTTPStatus.BAD_REQUEST, error.message) from None
            check_names(self._form, self._fields, "form field", self._path)
        return self._form


class _FileParser(MultiPartParser):
    target: IO[bytes]

    def on_headers_finished(self) -> None:
        super().on_headers_finished()
        part = self._current_part
        if part.file is not None:
            part.file.file.close()  # empty, and not yet on the disk
            part.file = UploadFile(
                cast("BinaryIO", self.target),
                size=0,
                filename=part.file.filename,
                headers=part.file.headers,
            )


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
    while level := [node for node in level if isinstance(node, dict | list)]:
        depth += 1
        if depth > _MAX_DEPTH:
            raise _make_depth_error()
        names += sum(len(node) for node in level if isinstance(node, dict))
        elements += sum(len(node) for node in level if isinstance(node, list))
        for count, most, what in ((names, _MAX_NAMES, "names"), (elements, max_elements, "array elements")):
            if count > most:
                raise PayloadTooLargeError(
                    f"the body has {count} {what} or more, and {most} is the most: send only the documented "
                    "fields, and upload data as a data set"
                )
        level = [value for node in level for value in (node.values() if isinstance(node, dict) else node)]


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
