"""Figures of a finished job: drawn by a process of their own when somebody first wants one, and kept."""

import asyncio
import sys
from asyncio.subprocess import PIPE
from collections.abc import Mapping
from errno import ENOSPC
from typing import Annotated, Any

from fastapi import APIRouter, Path, Response

from islands.errors import IslandsError
from islands_api.auth import Caller, Reader
from islands_api.doors import AtDoors, Doors
from islands_api.problems import RESPONSES, NoSuchThing
from islands_api.routes.jobs import Id
from islands_api.routes.models import Rank, finished, stored
from islands_api.schemas import Names
from islands_service.specification import Identification
from islands_service.store.database import StoreFull

router = APIRouter(prefix="/v1/jobs", tags=["figures"], responses=RESPONSES)

#: Figures of a model, and of a whole search: the names of the galleries' tables, as a test makes sure. To
#: import the galleries here would make every start of the service wait for matplotlib.
MODEL_FIGURES = ("free-run", "loop", "hold", "residuals")
SEARCH_FIGURES = ("record", "front", "convergence", "islands")

#: The figure that a search of a single island lacks.
_OF_SEVERAL = "islands"

#: Seconds that drawing may take: until then nobody else's figures are drawn.
_PATIENCE = 120.0

#: A model's simulation, as numbers.
SIMULATION = "free-run.json"

_SVG: dict[int | str, dict[str, Any]] = {200: {"content": {"image/svg+xml": {"schema": {"type": "string"}}}}}

_HTML: dict[int | str, dict[str, Any]] = {200: {"content": {"text/html": {"schema": {"type": "string"}}}}}

#: A report brings its own style and figures, and needs nothing else.
REPORT = "report.html"
_REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'"

ModelFigure = Annotated[
    str,
    Path(
        pattern=r"^[a-z-]{1,20}$",
        description="One of the model's `figures`.",
        json_schema_extra={"enum": list(MODEL_FIGURES)},
    ),
]
SearchFigure = Annotated[
    str,
    Path(
        pattern=r"^[a-z-]{1,20}$",
        description="One of the job's `figures`.",
        json_schema_extra={"enum": list(SEARCH_FIGURES)},
    ),
]


class DrawingFailed(IslandsError):
    """The figures cannot be drawn."""


@router.get("/{job}/figures", response_model=Names)
async def search_figures(job: Id, caller: Reader, doors: AtDoors) -> Any:
    """Say which figures of the search there may be."""
    return {"items": _of_search(await finished(doors, caller, job))}


@router.get("/{job}/figures/{figure}.svg", response_class=Response, responses=_SVG)
async def search_figure(job: Id, figure: SearchFigure, caller: Reader, doors: AtDoors) -> Response:
    """See a figure of the search: the record, error against size, convergence, the islands' course."""
    _known(figure, _of_search(await finished(doors, caller, job)))
    return await _figure(doors, caller, job, f"{figure}.svg", None)


@router.get("/{job}/models/{rank}/figures", response_model=Names)
async def model_figures(job: Id, rank: Rank, caller: Reader, doors: AtDoors) -> Any:
    """Say which figures of a model there are."""
    await stored(doors, caller, job, rank)
    return {"items": MODEL_FIGURES}


@router.get("/{job}/models/{rank}/figures/{figure}.svg", response_class=Response, responses=_SVG)
async def model_figure(job: Id, rank: Rank, figure: ModelFigure, caller: Reader, doors: AtDoors) -> Response:
    """See a figure of a model: free run, hysteresis loop, holds, residual correlations."""
    await stored(doors, caller, job, rank)
    _known(figure, MODEL_FIGURES)
    return await _figure(doors, caller, job, f"{rank}/{figure}.svg", rank)


@router.get("/{job}/models/{rank}/simulation", response_model=dict[str, Any])
async def simulation(job: Id, rank: Rank, caller: Reader, doors: AtDoors) -> Response:
    """Take a model's free run over the validation data as numbers, thinned for a screen."""
    await stored(doors, caller, job, rank)
    return await _figure(doors, caller, job, f"{rank}/{SIMULATION}", rank, "application/json")


@router.get("/{job}/report", response_class=Response, responses=_HTML)
async def report(job: Id, caller: Reader, doors: AtDoors) -> Response:
    """Take the report of a job: one HTML file with its models and figures, to be kept or sent."""
    await finished(doors, caller, job)
    answer = await _figure(doors, caller, job, REPORT, None, "text/html; charset=utf-8")
    answer.headers["Content-Security-Policy"] = _REPORT_POLICY
    return answer


def _of_search(document: Mapping[str, Any]) -> tuple[str, ...]:
    several = document["settings"]["islands"] > 1
    return tuple(name for name in SEARCH_FIGURES if several or name != _OF_SEVERAL)


def _known(figure: str, figures: tuple[str, ...]) -> None:
    if figure not in figures:
        raise NoSuchThing(f"there is no figure {figure!r}: take one of {', '.join(figures)}")


async def _figure(
    doors: Doors, caller: Caller, job: str, name: str, rank: int | None, media: str = "image/svg+xml"
) -> Response:
    blob = await doors.do(doors.store.results.artefact, job, name)
    if blob is None:
        async with doors.drawings:
            # Somebody else may have had it drawn while we waited for our turn.
            blob = await doors.do(doors.store.results.artefact, job, name)
            if blob is None:
                await _draw(doors, caller, job, rank)
                blob = await doors.do(doors.store.results.artefact, job, name)
    if blob is None:
        raise NoSuchThing(f"job {job} has no figure {name}")
    data = await doors.do(doors.blobs.read, blob)
    return Response(data, media_type=media, headers={"Cache-Control": "private, max-age=86400, immutable"})


async def _draw(doors: Doors, caller: Caller, job: str, rank: int | None) -> None:
    spec = Identification.model_validate((await doors.do(doors.store.jobs.get, caller.owner, job)).spec)
    for dataset in spec.datasets:
        await doors.do(doors.store.datasets.get, caller.owner, dataset)  # it may have been deleted
    of = () if rank is None else ("--rank", str(rank))
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "islands_service.drawing", job, f"--owner={caller.owner}", *of),
        stderr=PIPE,
        env=doors.settings.environment(),
    )
    try:
        async with asyncio.timeout(_PATIENCE):
            _, complaint = await process.communicate()
    except TimeoutError:
        raise DrawingFailed(f"the figures of job {job} take longer than {_PATIENCE:.0f} s to draw") from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode == ENOSPC:
        raise StoreFull(f"there is no room for the figures of job {job}: make room")
    if process.returncode != 0:
        reason = complaint.decode(errors="replace").strip().rpartition("\n")[2]
        raise DrawingFailed(f"the figures of job {job} cannot be drawn: {reason or process.returncode}")
