"""Report of a comparison of models of any jobs, made by a separate process at every request."""

from typing import Annotated

from fastapi import APIRouter, Query, Response

from islands.errors import SettingsError
from islands_api.web.auth import Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import get_job_of_kind
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import StrictRoute
from islands_api.web.routes.figures import HTML_RESPONSES, REPORT_POLICY, run_figure_worker
from islands_api.web.routes.models import get_model
from islands_service.domain.job import IDENTIFICATION

router = APIRouter(prefix="/v1/comparisons", tags=["models"], responses=RESPONSES, route_class=StrictRoute)

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


@router.get("/report", response_class=Response, responses=HTML_RESPONSES)
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
