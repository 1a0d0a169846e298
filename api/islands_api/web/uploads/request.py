"""Request with a form whose file is received into a given file, instead of the system's temporary folder."""

from collections.abc import Collection
from http import HTTPStatus
from typing import IO, Any, BinaryIO, cast

from fastapi import Request
from starlette.datastructures import FormData, UploadFile
from starlette.exceptions import HTTPException
from starlette.formparsers import MultiPartException, MultiPartParser
from starlette.types import Receive, Scope

from islands_api.web.parameter_names import check_names


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
