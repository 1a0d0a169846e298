"""Endpoints of the service itself: presets, caller, liveness, readiness, metrics and types of problems."""

import asyncio
from asyncio import Future
from typing import Annotated, Any

from fastapi import APIRouter, Path, Response
from prometheus_client import CONTENT_TYPE_LATEST

from islands.errors import suggest
from islands.evolution.presets import (
    AUTO,
    AUTO_SUMMARY,
    PRESET_NAMES,
    PRESET_SUMMARIES,
    common_settings,
    list_fixed_settings,
    list_structures,
)
from islands_api.result_schemas import ProblemType
from islands_api.schemas import CallerView, Health, PresetPage
from islands_api.web.auth import Operator, Reader
from islands_api.web.dependencies import AppState, AppStateDep
from islands_api.web.problems import PROBLEMS, RESPONSES, NotReadyError, ResourceNotFoundError
from islands_api.web.requests import StrictRoute
from islands_service.domain.job_spec import SettingsChanges

#: Seconds that the database and the disk have to answer a readiness check.
_READY_SECONDS = 2.0

router = APIRouter(tags=["service"], responses=RESPONSES)

#: Routes that refuse unknown query parameters.
strict_router = APIRouter(responses=RESPONSES, route_class=StrictRoute)


@strict_router.get("/v1/presets", tags=["jobs"], response_model=PresetPage)
async def presets(_caller: Reader) -> Any:
    """List the presets of a job with their settings, and describe the settings."""
    summaries = {AUTO: AUTO_SUMMARY, **PRESET_SUMMARIES}
    return {
        "items": [
            {
                "name": name,
                "summary": summaries[name],
                "settings": common_settings(name),
                "structures": list_structures(name),
                "fixed": list_fixed_settings(name),
            }
            for name in PRESET_NAMES
        ],
        "settings": SettingsChanges.model_json_schema()["properties"],
    }


@strict_router.get("/v1/caller", tags=["service"], response_model=CallerView)
async def caller(caller: Reader) -> Any:
    """Return the owner and the scopes of the key or the token of this request."""
    return {"owner": caller.owner, "scopes": sorted(caller.scopes)}


@router.get("/healthz", response_model=Health)
async def healthz() -> Any:
    """Return 200 if the process is alive."""
    return {"status": "alive"}


@router.get("/readyz", response_model=Health)
async def readyz(state: AppStateDep) -> Any:
    """Return 200 if the database answers and data can be written, so that jobs are accepted.

    Ray may still be starting. A database that has damaged pages, lacks tables or is read-only is not ready.
    The pages of a large SQLite database are checked in the background, at the start and then once a minute.
    If the database, the disk or the object store hangs, the status is 503 after two seconds.
    """
    check = asyncio.ensure_future(state.run_blocking(_check_ready, state))
    # The thread of a hanging check cannot be interrupted: leave it behind.
    done, _ = await asyncio.wait({check}, timeout=_READY_SECONDS)
    if not done:
        check.add_done_callback(Future.exception)
        raise NotReadyError(
            f"the database, the disk or the object store has not answered within {_READY_SECONDS:.0f} s"
        )
    await check
    return {"status": "ready"}


def _check_ready(state: AppState) -> None:
    state.store.readiness.check()
    state.blobs.check_writable()


@router.get(
    "/metrics",
    response_class=Response,
    responses={200: {"content": {"text/plain": {"schema": {"type": "string"}}}}},
)
async def metrics(_operator: Operator, state: AppStateDep) -> Response:
    """Return metrics for Prometheus: queue, leases, evaluations per second, best error, latency."""
    return Response(await state.run_blocking(state.metrics.page), media_type=CONTENT_TYPE_LATEST)


@router.get("/problems/{kind}", response_model=ProblemType)
async def problem(
    kind: Annotated[
        str, Path(description="The last part of a problem's `type`.", examples=["invalid-record"])
    ],
) -> Any:
    """Describe a problem type."""
    for entry in PROBLEMS.values():
        if entry.type == kind:
            return {"type": f"/problems/{kind}", "status": int(entry.status), "title": entry.title}
    known = [entry.type for entry in PROBLEMS.values()]
    raise ResourceNotFoundError(f"there is no problem type {kind!r}{suggest(kind, known)}")
