"""The status page at ``/``: files of our own, which speak REST as every other client does."""

from functools import cache
from pathlib import Path

from fastapi import APIRouter, Response

from islands_api.problems import NoSuchThing

router = APIRouter(include_in_schema=False)

FOLDER = Path(__file__).parents[1] / "dashboard"

#: What may be asked for, and what it is.
FILES = {
    "index.html": "text/html; charset=utf-8",
    "islands.css": "text/css; charset=utf-8",
    "islands.js": "text/javascript; charset=utf-8",
}


@cache
def _file(name: str) -> bytes:
    return (FOLDER / name).read_bytes()


@router.get("/")
async def index() -> Response:
    """Show the jobs."""
    return Response(_file("index.html"), media_type=FILES["index.html"])


@router.get("/dashboard/{name}")
async def file(name: str) -> Response:
    """Give a file of the page."""
    if name not in FILES:
        raise NoSuchThing(f"the page has no file {name!r}")
    return Response(_file(name), media_type=FILES[name], headers={"Cache-Control": "no-cache"})
