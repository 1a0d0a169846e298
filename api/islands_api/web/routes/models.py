"""Models of a job: metrics, physics checks, exports; and the result as a whole."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Response

from islands.io.export import EXPORTS, export
from islands.io.models import model_from_json
from islands_api.schemas import ModelPage, ModelView
from islands_api.web.auth import Principal, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.job_submission import get_job_of_kind, get_result
from islands_api.web.problems import RESPONSES, ResourceNotFoundError
from islands_api.web.responses import JSONDocument, JSONItems
from islands_api.web.routes.jobs import Id
from islands_service.domain.job import IDENTIFICATION
from islands_service.store.results import StoredModel

router = APIRouter(prefix="/v1/jobs", tags=["models"], responses=RESPONSES)

#: A model's place in its result.
Rank = Annotated[int, Path(ge=1, le=10_000, description="1 is the best on the validation data.")]

#: Media types of exports, where they are not plain text, and the ends of their files.
_TYPES = {"json": "application/json", "mathml": "application/mathml+xml"}
_ENDS = {"python": "py", "c": "c", "matlab": "m", "latex": "tex", "json": "json", "mathml": "xml"}

_TEXT: dict[str, Any] = {"schema": {"type": "string"}}
_EXPORTED: dict[int | str, dict[str, Any]] = {
    200: {
        "content": {
            "text/plain": _TEXT,
            _TYPES["mathml"]: _TEXT,
            _TYPES["json"]: {"schema": {"type": "object"}},
        }
    }
}


@router.get("/{job}/models", response_model=ModelPage)
async def models(job: Id, caller: Reader, state: AppStateDep) -> Any:
    """Look at the models of a job, best first; there are none before it has succeeded."""
    await get_job_of_kind(state, caller, job, IDENTIFICATION)
    return await state.run_blocking(
        lambda: JSONItems([model.document for model in state.store.results.models(job)])
    )


@router.get("/{job}/models/{rank}", response_model=ModelView)
async def model(job: Id, rank: Rank, caller: Reader, state: AppStateDep) -> Any:
    """Look at one model."""
    return JSONDocument((await stored(state, caller, job, rank)).document)


@router.get(
    "/{job}/models/{rank}/export",
    response_class=Response,
    responses=_EXPORTED,
)
async def exported(
    job: Id,
    rank: Rank,
    caller: Reader,
    state: AppStateDep,
    form: Annotated[
        str, Query(alias="format", description="A kind of text.", json_schema_extra={"enum": list(EXPORTS)})
    ] = "python",
) -> Response:
    """Take a model with you: as Python, C, MATLAB, an equation, or a model file."""
    found = await stored(state, caller, job, rank)
    text = await state.run_blocking(export, model_from_json(found.file, f"model {rank}"), form)
    name = f"model-{rank:02d}.{_ENDS.get(form, 'txt')}"
    return Response(
        text,
        media_type=_TYPES.get(form, "text/plain"),
        headers={"Content-Disposition": f'inline; filename="{name}"'},
    )


@router.get("/{job}/result", response_model=dict[str, Any])
async def result(job: Id, caller: Reader, state: AppStateDep) -> Any:
    """Take the whole result, in the form of `result.json`, or of `discrepancy.json`."""
    found = await state.run_blocking(state.store.jobs.get, caller.owner, job)
    document = await get_result(state, found)
    if found.kind != IDENTIFICATION:
        return JSONDocument(document)
    models = await state.run_blocking(state.store.results.models, job)
    return JSONDocument({**document, "models": [model.document for model in models]})


async def stored(state: AppState, caller: Principal, job: str, rank: int) -> StoredModel:
    """Return a model of a finished job.

    Raises
    ------
    ResultNotReadyError, ResourceNotFoundError
    """
    await get_result(state, await get_job_of_kind(state, caller, job, IDENTIFICATION))
    found = await state.run_blocking(state.store.results.models, job, rank)
    if not found:
        raise ResourceNotFoundError(f"job {job} has no model {rank}: look at its /models")
    return found[0]
