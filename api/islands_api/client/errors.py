"""Errors of the clients: problems that the service reports, and failures to reach it."""

from collections.abc import Mapping
from typing import Any

from islands.errors import IslandsError


class ServiceError(IslandsError):
    """The service answered with a problem. The message is its detail.

    Attributes
    ----------
    status : int
        HTTP status.
    type : str
        Type of the problem, ``/problems/invalid-record`` and so on: see docs/how-to/use-the-rest-api.md.
    detail : str
        What is wrong, and what to do.
    document : mapping
        The whole problem document.
    """

    def __init__(self, status: int, document: Mapping[str, Any]) -> None:
        detail = document.get("detail") or document.get("title") or f"HTTP {status}"
        super().__init__(str(detail))
        self.status, self.detail, self.document = status, str(detail), document
        self.type = str(document.get("type", "about:blank"))


class ServiceUnreachableError(IslandsError):
    """The service does not answer."""


class JobFailedError(IslandsError):
    """A job has failed or was cancelled while the caller waited for its success."""
