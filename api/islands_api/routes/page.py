"""The status page at ``/``: files of our own, which speak REST as every other client does."""

from functools import cache
from pathlib import Path

from fastapi import APIRouter, Response

from islands_api.problems import NoSuchThing

router = APIRouter(include_in_schema=False)

FOLDER = Path(__file__).parents[1] / "dashboard"

_SCRIPT = "text/javascript; charset=utf-8"
_STYLE = "text/css; charset=utf-8"

#: What may be asked for, and what it is. A newcomer's module is an entry here, and a preload in index.html.
FILES = {
    "index.html": "text/html; charset=utf-8",
    "icon.svg": "image/svg+xml",
    "islands.css": _STYLE,
    "job.css": _STYLE,
    "api.js": _SCRIPT,
    "banner.js": _SCRIPT,
    "chart.js": _SCRIPT,
    "clock.js": _SCRIPT,
    "confirm.js": _SCRIPT,
    "course.js": _SCRIPT,
    "dataset.js": _SCRIPT,
    "dom.js": _SCRIPT,
    "equation.js": _SCRIPT,
    "figures.js": _SCRIPT,
    "islands.js": _SCRIPT,
    "job.js": _SCRIPT,
    "jobs.js": _SCRIPT,
    "key.js": _SCRIPT,
    "models.js": _SCRIPT,
    "numbers.js": _SCRIPT,
    "scale.js": _SCRIPT,
    "state.js": _SCRIPT,
    "watch.js": _SCRIPT,
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
