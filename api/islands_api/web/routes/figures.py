"""Figures, reports and FMUs of jobs: made by a separate process at the first request, then stored."""

import asyncio
import errno
import sys
from asyncio.subprocess import PIPE
from collections.abc import Sequence
from time import monotonic
from typing import Annotated, Any

import structlog
from fastapi import APIRouter, Path, Query, Response

from islands.errors import IslandsError, SettingsError, suggest
from islands.models.latent import LatentModel
from islands.persistence.models import model_from_json
from islands.report.figures.availability import list_model_figures
from islands.report.figures.names import LEAST_ISLANDS, MODEL_FIGURES, SEARCH_FIGURES
from islands_api.result_schemas import FreeRun
from islands_api.schemas import Names
from islands_api.web.auth import Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import get_job_of_kind, get_result
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.requests import StrictRoute
from islands_api.web.routes.jobs import Id
from islands_api.web.routes.models import Rank, get_model
from islands_service.domain.job import (
    DISCREPANCY,
    FMU,
    FREE_RUN,
    IDENTIFICATION,
    MONITORING,
    REPORT,
    name_free_run_artefacts,
)
from islands_service.domain.job_spec import parse_identification
from islands_service.intake.confined_process import REQUESTS
from islands_service.store.blobs import BlobNotFoundError, DataFolderUnavailableError
from islands_service.store.buckets import ObjectStoreError
from islands_service.store.database import StorageFullError, StoreUnavailableError
from islands_service.store.results import StoredModel

log = structlog.get_logger()

router = APIRouter(prefix="/v1/jobs", tags=["figures"], responses=RESPONSES, route_class=StrictRoute)

#: Timeout in seconds of a figure process, which blocks the figures of all other jobs.
_DRAWING_TIMEOUT = 120.0

#: Seconds for which a failed figure is not drawn again.
_FAILURE_SECONDS = 300.0

#: Maximum number of failures that are stored.
_MAX_FAILURES = 1000

#: Options of the process that makes an artefact without all figures, by the end of its name.
_PARTS = {FREE_RUN: "--numbers", FMU: "--fmu"}

SVG_TYPE = "image/svg+xml"

SVG_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"content": {SVG_TYPE: {"schema": {"type": "string"}}}}
}

_FMU_TYPE = "application/octet-stream"

_FMU_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"content": {_FMU_TYPE: {"schema": {"type": "string", "format": "binary"}}}}
}

CSV_TYPE = "text/csv; charset=utf-8"

CSV_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/csv": {"schema": {"type": "string"}}}}
}

HTML_RESPONSES: dict[int | str, dict[str, Any]] = {
    200: {"content": {"text/html": {"schema": {"type": "string"}}}}
}

#: Content-Security-Policy of a report, which contains its styles and figures and loads nothing.
REPORT_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; frame-ancestors 'none'"

ModelFigure = Annotated[
    str,
    Path(
        pattern=r"^[a-z-]{1,20}[0-9]?$",
        description=f"One of the model's `figures`: {', '.join(MODEL_FIGURES)}; of several outputs "
        "free-run-1, free-run-2, ...",
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

comparison_router = APIRouter(
    prefix="/v1/comparisons", tags=["models"], responses=RESPONSES, route_class=StrictRoute
)

#: Models of a comparison.
ComparedModels = Annotated[
    list[Annotated[str, Query(pattern=r"^[0-9A-Za-z_-]{1,64}(:[1-9][0-9]{0,3})?$")]],
    Query(
        alias="model",
        min_length=2,
        max_length=6,
        description="`JOB:RANK`, or `JOB` for its recommended model; repeat it for every model.",
    ),
]


class FigureError(IslandsError):
    """The figures cannot be drawn."""


class FigureFailures:
    """Recent failures of figure processes: repeated attempts would delay the figures of other jobs."""

    def __init__(self) -> None:
        self._failures: dict[tuple[str, int | None, str | None], tuple[float, IslandsError]] = {}

    def remember(self, job: str, rank: int | None, error: IslandsError, part: str | None = None) -> None:
        """Store the error of a failed attempt."""
        self._failures.pop((job, rank, part), None)
        if len(self._failures) == _MAX_FAILURES:
            del self._failures[next(iter(self._failures))]
        self._failures[job, rank, part] = monotonic() + _FAILURE_SECONDS, error

    def refuse(self, job: str, rank: int | None, part: str | None = None) -> None:
        """Raise the error of a recent failed attempt, if there is one.

        Raises
        ------
        FigureError, BlobNotFoundError
        """
        until, error = self._failures.get((job, rank, part), (0.0, None))
        if error is not None and monotonic() < until:
            raise type(error)(*error.args)


#: Failures of this process.
_FAILURES = FigureFailures()


@router.get("/{job}/figures", response_model=Names)
async def search_figures(job: Id, caller: Reader, state: AppStateDep) -> Any:
    """List the names of the figures of the search."""
    return {"items": await _list_search_figures(state, caller, job)}


@router.get("/{job}/figures/{figure}.svg", response_class=Response, responses=SVG_RESPONSES)
async def search_figure(job: Id, figure: SearchFigure, caller: Reader, state: AppStateDep) -> Response:
    """Return a figure of the search: record, error against size, convergence, or error of each island."""
    _check_figure(figure, await _list_search_figures(state, caller, job))
    return await _figure_response(state, caller, job, f"{figure}.svg", None)


@router.get("/{job}/figures/{figure}.csv", response_class=Response, responses=CSV_RESPONSES)
async def search_figure_table(job: Id, figure: SearchFigure, caller: Reader, state: AppStateDep) -> Response:
    """Return the points of the lines of a figure of the search."""
    _check_figure(figure, await _list_search_figures(state, caller, job))
    return await _figure_response(state, caller, job, f"{figure}.csv", None, CSV_TYPE)


@router.get("/{job}/models/{rank}/figures", response_model=Names)
async def model_figures(job: Id, rank: Rank, caller: Reader, state: AppStateDep) -> Any:
    """List the names of the figures of a model."""
    return {"items": await _list_model_figures(state, job, await get_model(state, caller, job, rank))}


@router.get("/{job}/models/{rank}/figures/{figure}.svg", response_class=Response, responses=SVG_RESPONSES)
async def model_figure(
    job: Id, rank: Rank, figure: ModelFigure, caller: Reader, state: AppStateDep
) -> Response:
    """Return a figure of a model, such as its free run or its residual correlations."""
    found = await get_model(state, caller, job, rank)
    _check_figure(figure, await _list_model_figures(state, job, found))
    return await _figure_response(state, caller, job, f"{rank}/{figure}.svg", rank)


@router.get("/{job}/models/{rank}/figures/{figure}.csv", response_class=Response, responses=CSV_RESPONSES)
async def model_figure_table(
    job: Id, rank: Rank, figure: ModelFigure, caller: Reader, state: AppStateDep
) -> Response:
    """Return the points of the lines of a figure of a model."""
    found = await get_model(state, caller, job, rank)
    _check_figure(figure, await _list_model_figures(state, job, found))
    return await _figure_response(state, caller, job, f"{rank}/{figure}.csv", rank, CSV_TYPE)


@router.get("/{job}/models/{rank}/simulation", response_model=FreeRun)
async def simulation(
    job: Id,
    rank: Rank,
    caller: Reader,
    state: AppStateDep,
    output: Annotated[int, Query(ge=1, le=8, description="Number of the output, if there are several.")] = 1,
) -> Response:
    """Return the free run of a model over the validation data, and its 90 % band, as numbers for a screen."""
    await get_model(state, caller, job, rank)
    outputs = await _count_outputs(state, job)
    if output > outputs:
        raise ResourceNotFoundError(
            f"the model has {outputs} output{'s' * (outputs > 1)}, there is no {output}"
        )
    name = name_free_run_artefacts(rank, outputs)[output - 1]
    return await _figure_response(state, caller, job, name, rank, "application/json")


@router.get("/{job}/models/{rank}/fmu", response_class=Response, responses=_FMU_RESPONSES)
async def fmu(job: Id, rank: Rank, caller: Reader, state: AppStateDep) -> Response:
    """Export a model as FMU of FMI 3.0 for co-simulation, compiled for the machine of the service."""
    await get_model(state, caller, job, rank)
    response = await _figure_response(state, caller, job, f"{rank}/{FMU}", rank, _FMU_TYPE)
    response.headers["Content-Disposition"] = f'attachment; filename="model-{rank:02d}.fmu"'
    return response


@router.get("/{job}/report", response_class=Response, responses=HTML_RESPONSES)
async def report(job: Id, caller: Reader, state: AppStateDep) -> Response:
    """Return the report of a job: a self-contained HTML file with the result and its figures."""
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    await get_result(state, found)
    if found.kind == MONITORING:
        raise ResourceNotFoundError(
            f"job {job} has analysed a record of a monitor and has no report: see its /result"
        )
    if found.kind == DISCREPANCY and not await state.run_blocking(state.store.results.artefact, job, REPORT):
        raise ResourceNotFoundError(
            f"job {job} was cancelled and has no report: see its /result, or resume it"
        )
    response = await _figure_response(state, caller, job, REPORT, None, "text/html; charset=utf-8")
    response.headers["Content-Security-Policy"] = REPORT_POLICY
    return response


async def _list_search_figures(state: AppState, caller: Principal, job: str) -> tuple[str, ...]:
    document = await get_result(state, await get_job_of_kind(state, caller, job, IDENTIFICATION))
    if "outputs" in document:
        return ()
    # A fit of a class of models is no evolution.
    islands = document["settings"].get("islands", 0)
    return tuple(name for name in SEARCH_FIGURES if islands >= LEAST_ISLANDS.get(name, 0))


async def _list_model_figures(state: AppState, job: str, found: StoredModel) -> tuple[str, ...]:
    document = await state.run_blocking(state.store.results.document, job) or {}
    if "outputs" in document:
        return tuple(f"free-run-{number + 1}" for number in range(len(document["outputs"])))
    # Other models have the same figures whatever their terms are.
    is_read = found.document.get("kind") == LatentModel.kind or found.document.get("form") == "static"
    model = model_from_json(found.file, f"model {found.rank}") if is_read else None
    return list_model_figures(model, document["loop"])


async def _count_outputs(state: AppState, job: str) -> int:
    document = await state.run_blocking(state.store.results.document, job) or {}
    return len(document["outputs"]) if "outputs" in document else 1


def _check_figure(figure: str, figures: tuple[str, ...]) -> None:
    if figure not in figures:
        raise ResourceNotFoundError(
            f"there is no figure {figure!r}: use one of {', '.join(figures)}{suggest(figure, figures)}"
        )


async def _figure_response(
    state: AppState, caller: Principal, job: str, name: str, rank: int | None, media: str = SVG_TYPE
) -> Response:
    blob = await state.run_blocking(state.store.results.artefact, job, name)
    if blob is None:
        quotas = await state.quotas(caller.owner)
        with state.drawings.count(caller.owner, quotas.max_drawings):
            async with state.figure_slots.hold(caller.owner):
                # Another request may have drawn the figure in the meantime.
                blob = await state.run_blocking(state.store.results.artefact, job, name)
                if blob is None:
                    await _draw(state, caller, job, rank, _find_part(name))
                    blob = await state.run_blocking(state.store.results.artefact, job, name)
    if blob is None:
        raise ResourceNotFoundError(f"job {job} has no figure {name}")
    data = await state.run_blocking(state.blobs.read, blob)
    # A browser may use several keys one after the other.
    headers = {"Cache-Control": "private, max-age=86400, immutable", "Vary": "Authorization"}
    return Response(data, media_type=media, headers=headers)


def _find_part(name: str) -> str | None:
    """Return the option of the process that makes an artefact alone; None if it is made with all figures."""
    # The page shows the free run first; the figures take several seconds.
    return next((option for end, option in _PARTS.items() if name.endswith(end)), None)


async def _draw(state: AppState, caller: Principal, job: str, rank: int | None, part: str | None) -> None:
    found = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    for dataset in parse_identification(found.spec).datasets:
        await state.run_blocking(state.store.datasets.get, caller.owner, dataset, deleted=True)
    _FAILURES.refuse(job, rank, part)
    try:
        await _run_drawing(state, caller, job, rank, part)
    except (FigureError, BlobNotFoundError) as error:
        _FAILURES.remember(job, rank, error, part)
        raise


async def _run_drawing(
    state: AppState, caller: Principal, job: str, rank: int | None, part: str | None
) -> None:
    options = [] if rank is None else ["--rank", str(rank)]
    if part is not None:
        options.append(part)
    what, done = ("FMU", "compiled") if part == _PARTS[FMU] else ("figures", "drawn")
    await run_figure_worker(state, caller, [job, *options], f"the {what} of job {job} cannot be {done}")


async def run_figure_worker(
    state: AppState, caller: Principal, arguments: Sequence[str], failure: str
) -> bytes:
    """Run `islands_service.figure_worker` for an owner; return its standard output.

    Parameters
    ----------
    arguments : sequence of str
    failure : str
        Beginning of the message of an error.

    Raises
    ------
    FigureError, StorageFullError, DataFolderUnavailableError, ObjectStoreError, StoreUnavailableError,
    BlobNotFoundError
    """
    readers = state.settings.readers
    inherited = {} if readers is None else {REQUESTS: str(readers)}
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "islands_service.figure_worker", f"--owner={caller.owner}", *arguments),
        stdout=PIPE,
        stderr=PIPE,
        env=state.settings.environment() | inherited,
        pass_fds=tuple(map(int, inherited.values())),
    )
    try:
        async with asyncio.timeout(_DRAWING_TIMEOUT):
            stdout, stderr = await process.communicate()
    except TimeoutError:
        raise FigureError(f"{failure}: it would take longer than {_DRAWING_TIMEOUT:.0f} s") from None
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    if process.returncode == 0:
        return stdout
    # The error output is for the log: it may contain paths and messages of the database driver.
    reason = _decode(stderr)
    match process.returncode:
        case errno.EINVAL:
            raise FigureError(f"{failure}: {_decode(stdout)}")
        case errno.ENOSPC:
            raise StorageFullError(reason)
        case errno.EROFS:
            raise DataFolderUnavailableError(reason)
        case errno.EIO:
            raise ObjectStoreError(reason)
        case errno.EAGAIN:
            raise StoreUnavailableError(reason)
        case errno.ENODATA:
            raise BlobNotFoundError(reason)
    log.error("drawing failed", arguments=arguments, status=process.returncode, reason=reason)
    raise FigureError(f"{failure}: the log of the service gives the reason")


def _decode(output: bytes) -> str:
    return output.decode(errors="replace").strip()


@comparison_router.get("/report", response_class=Response, responses=HTML_RESPONSES)
async def comparison_report(models: ComparedModels, caller: Reader, state: AppStateDep) -> Response:
    """Return the report of a comparison: a self-contained HTML file.

    It has the free runs over the validation data, errors, equations, parameters and the settings that differ.
    """
    found = [await _find_model(state, caller, text) for text in models]
    if len(set(found)) < len(found):
        raise SettingsError("a model is given twice: compare different ones")
    first, *others = found
    arguments = [first[0], "--rank", str(first[1]), "--compare", *(f"{job}:{rank}" for job, rank in others)]
    quotas = await state.quotas(caller.owner)
    with state.drawings.count(caller.owner, quotas.max_drawings):
        async with state.figure_slots.hold(caller.owner):
            page = await run_figure_worker(state, caller, arguments, "the models cannot be compared")
    headers = {"Content-Security-Policy": REPORT_POLICY, "Cache-Control": "private, no-store"}
    return Response(page, media_type="text/html; charset=utf-8", headers=headers)


async def _find_model(state: AppState, caller: Principal, text: str) -> tuple[str, int]:
    """Return the job and the rank of a model that exists."""
    name, _, rank = text.partition(":")
    job = await get_job_of_kind(state, caller, name, IDENTIFICATION)
    number = int(rank) if rank else int((job.summary or {}).get("rank") or 1)
    await get_model(state, caller, name, number)
    return name, number
