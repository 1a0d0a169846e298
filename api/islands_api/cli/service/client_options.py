"""Options of commands that use a service over REST, and the client that they open."""

from collections.abc import Callable
from typing import Annotated, Protocol, TypeVar

import typer

from islands_api.client import Client

T_co = TypeVar("T_co", covariant=True)

Url = Annotated[str, typer.Option("--url", envvar="ISLANDS_URL", help="The service's address.")]
ApiKey = Annotated[
    str | None,
    typer.Option("--key", envvar="ISLANDS_KEY", help="API key; not needed on the service's own machine."),
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON.")]

#: Default address of the service.
LOCAL = "http://127.0.0.1:8000"

#: Seconds during which a command repeats a call to an unreachable service. Watching a job uses the client's
#: default, which is longer.
RETRY_SECONDS = 5.0

#: Largest page that a service returns.
MAX_PAGE = 200


def open_client(url: str, key: str | None) -> Client:
    """Return a client that repeats calls to an unreachable service for a few seconds."""
    return Client(url, key, retry=RETRY_SECONDS)


class Page(Protocol[T_co]):
    """Page of a list, and the cursor of the next one."""

    @property
    def items(self) -> tuple[T_co, ...]:
        """Entries of the page."""

    @property
    def next(self) -> str | None:
        """Cursor of the next page; None on the last one."""


def read_pages(read: Callable[[str | None, int], Page[T_co]], limit: int) -> list[T_co]:
    """Return the first entries of a list, given a function that reads a page from a cursor and a size."""
    found: list[T_co] = []
    page = read(None, min(limit, MAX_PAGE))
    found += page.items
    while page.next is not None and len(found) < limit:
        page = read(page.next, min(limit - len(found), MAX_PAGE))
        found += page.items
    return found
