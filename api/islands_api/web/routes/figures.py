"""Figures of a finished job: drawn by a process of their own when somebody first wants one, and kept."""

import asyncio
import errno
import sys
from asyncio.subprocess import PIPE
from time import monotonic
from typing import Annotated, Any

import structlog
from fastapi import APIRouter, Path, Response

from islands.errors import IslandsError
from islands_api.schemas import Names
from islands_api.web.auth import Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import get_job_of_kind, get_result
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.routes.jobs import Id
from islands_api.web.routes.models import Rank, stored
from islands_service.domain.job import IDENTIFICATION, REPORT
from islands_service.domain.job_spec import identification_of
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.database import StorageFullError, StoreUnavailableError

log = structlog.get_logger()

router = APIRouter(prefix="/v1/jobs", tags=["figures"], responses=RESPONSES)

#: Figures of a model, and of a whole search: the names of the galleries' tables, as a test makes sure. To
#: import the galleries here would make every start of the service wait for matplotlib.
MODEL_FIGURES = ("free-run", "loop", "hold", "residuals")
SEARCH_FIGURES = ("record", "front", "convergence", "islands")

#: The figure that a search of a single island lacks.
_OF_SEVERAL = "islands"

#: Seconds that drawing may take: until then nobody else's figures are drawn.
_PATIENCE = 120.0

#: Seconds for which what could not be drawn is not tried again, and how many such are remembered.
_REST, _REMEMBERED = 300.0, 1000

#: A model's simulation, as numbers.
SIMULATION = "free-run.json"

_SVG: dict[int | str, dict[str, Any]] = {200: {"content": {"image/svg+xml": {"schema": {"type": "string"}}}}}

_HTML: dict[int | str, dict[str, Any]] = {200: {"content": {"text/html": {"schema": {"type": "string"}}}}}

#: A report brings its own style and figures, and needs nothing else.
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


class FigureError(IslandsError):
    """The figures cannot be drawn."""


class FigureFailures:
    """What could not be drawn of late: to try it again would keep others from their figures."""

    def __init__(self) -> None:
        self._known: dict[tuple[str, int | None], tuple[float, IslandsError]] = {}

    def remember(self, job: str, rank: int | None, error: IslandsError) -> None:
        """Keep why figures could not be drawn."""
        self._known.pop((job, rank), None)
        if len(self._known) == _REMEMBERED:
            del self._known[next(iter(self._known))]
        self._known[job, rank] = monotonic() + _REST, error

    def refuse(self, job: str, rank: int | None) -> None:
        """Raise once more what came of an earlier try.

        Raises
        ------
        FigureError, BlobNotFoundError
        """
        until, error = self._known.get((job, rank), (0.0, None))
        if error is not None and monotonic() < until:
            raise type(error)(*error.args)


#: Of this process: a job's id is of no other service.
_FAILURES = FigureFailures()


@router.get("/{job}/figures", response_model=Names)
async def search_figures(job: Id, caller: Reader, state: AppStateDep) -> Any:
    """Say which figures of the search there may be."""
    return {"items": await _of_search(state, caller, job)}


@router.get("/{job}/figures/{figure}.svg", response_class=Response, responses=_SVG)
async def search_figure(job: Id, figure: SearchFigure, caller: Reader, state: AppStateDep) -> Response:
    """See a figure of the search: the record, error against size, convergence, the islands' course."""
    _known(figure, await _of_search(state, caller, job))
    return await _figure(state, caller, job, f"{figure}.svg", None)


@router.get("/{job}/models/{rank}/figures", response_model=Names)
async def model_figures(job: Id, rank: Rank, caller: Reader, state: AppStateDep) -> Any:
    """Say which figures of a model there are."""
    await stored(state, caller, job, rank)
    return {"items": MODEL_FIGURES}


@router.get("/{job}/models/{rank}/figures/{figure}.svg", response_class=Response, responses=_SVG)
async def model_figure(
    job: Id, rank: Rank, figure: ModelFigure, caller: Reader, state: AppStateDep
) -> Response:
    """See a figure of a model: free run, hysteresis loop, holds, residual correlations."""
    await stored(state, caller, job, rank)
    _known(figure, MODEL_FIGURES)
    return await _figure(state, caller, job, f"{rank}/{figure}.svg", rank)


@router.get("/{job}/models/{rank}/simulation", response_model=dict[str, Any])
async def simulation(job: Id, rank: Rank, caller: Reader, state: AppStateDep) -> Response:
    """Take a model's free run over the validation data as numbers, thinned for a screen."""
    await stored(state, caller, job, rank)
    return await _figure(state, caller, job, f"{rank}/{SIMULATION}", rank, "application/json")


@router.get("/{job}/report", response_class=Response, responses=_HTML)
async def report(job: Id, caller: Reader, state: AppStateDep) -> Response:
    """Take the report of a job: one HTML file with what it found and its figures, to be kept or sent."""
    await get_result(state, await state.run_blocking(state.store.jobs.get, caller.owner, job))
    answer = await _figure(state, caller, job, REPORT, None, "text/html; charset=utf-8")
    answer.headers["Content-Security-Policy"] = _REPORT_POLICY
    return answer


async def _of_search(state: AppState, caller: Principal, job: str) -> tuple[str, ...]:
    document = await get_result(state, await get_job_of_kind(state, caller, job, IDENTIFICATION))
    several = document["settings"]["islands"] > 1
    return tuple(name for name in SEARCH_FIGURES if several or name != _OF_SEVERAL)


def _known(figure: str, figures: tuple[str, ...]) -> None:
    if figure not in figures:
        raise ResourceNotFoundError(f"there is no figure {figure!r}: take one of {', '.join(figures)}")


async def _figure(
    state: AppState, caller: Principal, job: str, name: str, rank: int | None, media: str = "image/svg+xml"
) -> Response:
    blob = await state.run_blocking(state.store.results.artefact, job, name)
    if blob is None:
        async with state.figure_slots:
            # Somebody else may have had it drawn while we waited for our turn.
            blob = await state.run_blocking(state.store.results.artefact, job, name)
            if blob is None:
                await _draw(state, caller, job, rank)
                blob = await state.run_blocking(state.store.results.artefact, job, name)
    if blob is None:
        raise ResourceNotFoundError(f"job {job} has no figure {name}")
    data = await state.run_blocking(state.blobs.read, blob)
    # A browser may have several keys, one after the other.
    headers = {"Cache-Control": "private, max-age=86400, immutable", "Vary": "Authorization"}
    return Response(data, media_type=media, headers=headers)


async def _draw(state: AppState, caller: Principal, job: str, rank: int | None) -> None:
    found = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    for dataset in identification_of(found.spec).datasets:
        await state.run_blocking(state.store.datasets.get, caller.owner, dataset)  # it may have been deleted
    _FAILURES.refuse(job, rank)
    try:
        await _drawn(state, caller, job, rank)
    except (FigureError, BlobNotFoundError) as error:
        _FAILURES.remember(job, rank, error)
        raise


async def _drawn(state: AppState, caller: Principal, job: str, rank: int | None) -> None:
    of = () if rank is None else ("--rank", str(rank))
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "islands_service.reports.figure_worker", job, f"--owner={caller.owner}", *of),
        stdout=PIPE,
        stderr=PIPE,
        env=state.settings.environment(),
    )
    try:
        async with asyncio.timeout(_PATIENCE):
            said, complaint = await process.communicate()
    except TimeoutError:
        raise FigureError(f"the figures of job {job} take longer than {_PATIENCE:.0f} s to draw") from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode == 0:
        return
    # What is not meant for whoever asked: paths, and what the database's driver says.
    reason = _text(complaint)
    match process.returncode:
        case errno.EINVAL:
            raise FigureError(f"the figures of job {job} cannot be drawn: {_text(said)}")
        case errno.ENOSPC:
            raise StorageFullError(reason)
        case errno.EAGAIN:
            raise StoreUnavailableError(reason)
        case errno.ENODATA:
            raise BlobNotFoundError(reason)
    log.error("drawing failed", job=job, status=process.returncode, reason=reason)
    raise FigureError(
        f"the figures of job {job} cannot be drawn: why stands in the log, for whoever runs this service"
    )


def _text(said: bytes) -> str:
    return said.decode(errors="replace").strip()
