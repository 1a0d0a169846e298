"""Service endpoints: liveness, readiness, metrics, and descriptions of problem types."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Response
from prometheus_client import CONTENT_TYPE_LATEST

from islands_api.schemas import Health
from islands_api.web.auth import Operator
from islands_api.web.dependencies import AppStateDep
from islands_api.web.problems import PROBLEMS, RESPONSES, ResourceNotFoundError

router = APIRouter(tags=["service"], responses=RESPONSES)


@router.get("/healthz", response_model=Health)
async def healthz() -> Any:
    """Return 200 if the process is alive."""
    return {"status": "alive"}


@router.get("/readyz", response_model=Health)
async def readyz(state: AppStateDep) -> Any:
    """Return 200 if the database answers, so that jobs are accepted. Ray may still be starting."""
    await state.run_blocking(state.store.jobs.versions, [])
    return {"status": "ready"}


@router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
async def metrics(_operator: Operator, state: AppStateDep) -> Response:
    """Return metrics for Prometheus: queue, leases, evaluations per second, best error, latency."""
    return Response(await state.run_blocking(state.metrics.page), media_type=CONTENT_TYPE_LATEST)


@router.get("/problems/{kind}", response_model=dict[str, Any])
async def problem(
    kind: Annotated[
        str, Path(description="The last part of a problem's `type`.", examples=["invalid-record"])
    ],
) -> Any:
    """Describe a problem type."""
    for entry in PROBLEMS.values():
        if entry.type == kind:
            return {"type": f"/problems/{kind}", "status": int(entry.status), "title": entry.title}
    raise ResourceNotFoundError(f"there is no problem type {kind!r}")
