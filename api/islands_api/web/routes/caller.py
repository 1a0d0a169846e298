"""The caller: whose jobs a key or a token reaches, and its scopes."""

from typing import Any

from fastapi import APIRouter

from islands_api.schemas import CallerView
from islands_api.web.auth import Reader
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import StrictRoute

router = APIRouter(prefix="/v1/caller", tags=["service"], responses=RESPONSES, route_class=StrictRoute)


@router.get("", response_model=CallerView)
async def caller(caller: Reader) -> Any:
    """Return the owner and the scopes of the key or the token of this request."""
    return {"owner": caller.owner, "scopes": sorted(caller.scopes)}
