"""Linear systems of the models of a job about an operating point, and their figures."""

import json
from collections.abc import Mapping
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response

from islands.export.linear_system import NOTATIONS, write_linear_system
from islands.models.operating_point import parse_levels
from islands.models.state_space import FORMS, METHODS
from islands.report.figures.names import LINEAR_FIGURES
from islands_api.result_schemas import LinearSystemView
from islands_api.web.auth import Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import get_job_of_kind, get_result
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import StrictRoute
from islands_api.web.routes.figures import CSV_RESPONSES, CSV_TYPE, SVG_RESPONSES, SVG_TYPE, run_figure_worker
from islands_api.web.routes.jobs import Id
from islands_api.web.routes.models import Rank, get_model
from islands_service.domain.job import IDENTIFICATION, Job
from islands_service.store.results import StoredModel

router = APIRouter(prefix="/v1/jobs", tags=["models"], responses=RESPONSES, route_class=StrictRoute)

#: Media types and suffixes of the notations.
_FILES = {"json": ("application/json", "json"), "matlab": ("text/plain", "m"), "text": ("text/plain", "txt")}

#: Query parameter: the operating point.
Levels = Annotated[
    list[Annotated[str, Query(max_length=300)]],
    Query(
        alias="at",
        max_length=24,
        description="`NAME=VALUE`: level of an input, and of the output if the model rests at several; "
        "repeat it for every one. By default the operating point of a latent model, and the middle of the "
        "ranges of the data of others.",
        examples=[["u_V=2.5"]],
    ),
]

#: Query parameters: what is written, and how.
Form = Annotated[str, Query(description="What is written.", json_schema_extra={"enum": list(FORMS)})]
Notation = Annotated[
    str,
    Query(
        description="How: `matlab` is a program for the Control System Toolbox.",
        json_schema_extra={"enum": list(NOTATIONS)},
    ),
]
Continuous = Annotated[
    str | None,
    Query(
        description="The system in continuous time: `zoh`, the one with these samples at inputs that are "
        "held between them, or `tustin`. By default it is discrete.",
        json_schema_extra={"enum": list(METHODS)},
    ),
]

#: Path parameter: a figure of a linear system.
Figure = Annotated[
    str,
    Path(
        pattern=rf"^({'|'.join(LINEAR_FIGURES)})$",
        description="Figure of the linear system.",
        json_schema_extra={"enum": list(LINEAR_FIGURES)},
    ),
]

_TEXT = {"text/plain": {"schema": {"type": "string"}}}


@router.get(
    "/{job}/models/{rank}/linear-system",
    response_model=LinearSystemView,
    responses={200: {"content": _TEXT}},
)
async def linear_system(
    job: Id,
    rank: Rank,
    caller: Reader,
    state: AppStateDep,
    at: Levels = [],  # noqa: B006 - FastAPI copies it
    form: Form = FORMS[0],
    notation: Notation = "json",
    continuous: Continuous = None,
) -> Response:
    """Return the linear system of a model about an operating point: state space or transfer functions.

    Its signals are deviations from the operating point, where the model rests.
    """
    levels, (entry, stored, document) = parse_levels(at, "at"), await _find(state, caller, job, rank)

    def write() -> str:
        # The classes of results import the search.
        from islands.facade.results.model_analysis import split_point  # noqa: PLC0415
        from islands_service.domain.fitted_models import read_fitted  # noqa: PLC0415

        fitted = read_fitted(entry.id, stored.file, stored.document, document)
        system = fitted.linearise(*split_point(fitted.model, levels))
        if continuous is not None:
            system = system.to_continuous(continuous)
        return write_linear_system(system, form, notation)

    async with state.simulation_slots.hold(caller.owner):
        text = await state.run_blocking(write)
    media, suffix = _FILES[notation]
    file = f'inline; filename="model-{rank:02d}.{suffix}"'
    return Response(text, media_type=media, headers={"Content-Disposition": file})


@router.get(
    "/{job}/models/{rank}/linear-system/{figure}.svg", response_class=Response, responses=SVG_RESPONSES
)
async def linear_figure(
    job: Id,
    rank: Rank,
    figure: Figure,
    caller: Reader,
    state: AppStateDep,
    at: Levels = [],  # noqa: B006 - as above
) -> Response:
    """Return a figure of the linear system with 90 % bands: Bode, Nyquist, pole map or unit step."""
    drawn = await _draw(state, caller, job, rank, parse_levels(at, "at"))
    return Response(drawn[f"{figure}.svg"], media_type=SVG_TYPE)


@router.get(
    "/{job}/models/{rank}/linear-system/{figure}.csv", response_class=Response, responses=CSV_RESPONSES
)
async def linear_figure_table(
    job: Id,
    rank: Rank,
    figure: Figure,
    caller: Reader,
    state: AppStateDep,
    at: Levels = [],  # noqa: B006 - as above
) -> Response:
    """Return the points of the lines of a figure of the linear system."""
    drawn = await _draw(state, caller, job, rank, parse_levels(at, "at"))
    return Response(drawn[f"{figure}.csv"], media_type=CSV_TYPE)


async def _find(
    state: AppState, caller: Principal, job: str, rank: int
) -> tuple[Job, StoredModel, dict[str, Any]]:
    entry = await get_job_of_kind(state, caller, job, IDENTIFICATION)
    stored = await get_model(state, caller, job, rank)
    return entry, stored, await get_result(state, entry)


async def _draw(
    state: AppState, caller: Principal, job: str, rank: int, levels: Mapping[str, float]
) -> Mapping[str, str]:
    """Return all figures about an operating point, from memory if one of them was asked for before."""
    entry, _, _ = await _find(state, caller, job, rank)
    key = entry.id, entry.version, rank, tuple(sorted(levels.items()))
    quotas = await state.quotas(caller.owner)
    with state.drawings.count(caller.owner, quotas.max_drawings):
        async with state.figure_slots.hold(caller.owner):
            drawn = state.linear_figures.get(key)
            if drawn is None:
                arguments = [job, "--rank", str(rank), f"--linear={json.dumps(levels)}"]
                failure = f"the linear system of job {job} cannot be drawn"
                drawn = json.loads(await run_figure_worker(state, caller, arguments, failure))
                state.linear_figures.store(key, drawn)
    return drawn
