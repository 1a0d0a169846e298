"""Keys of the service, for operators: create, list, revoke."""

from typing import Annotated, Any

from fastapi import APIRouter, Path

from islands_api.admin_schemas import CreatedKey, KeyPage, KeyRequest, KeyView
from islands_api.web.auth import Administrator
from islands_api.web.dependencies import AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import JSONRoute
from islands_api.web.responses import JSONDocument, key_document

router = APIRouter(
    prefix="/v1/admin/keys", tags=["administration"], responses=RESPONSES, route_class=JSONRoute
)

_DAY_SECONDS = 86_400.0


@router.post("", status_code=201, response_model=CreatedKey)
async def create(request: KeyRequest, caller: Administrator, state: AppStateDep) -> Any:
    """Create a key. Its secret is shown once: only a hash is stored."""
    key, secret = await state.run_blocking(
        state.store.keys.create,
        request.name,
        frozenset(request.scopes),
        request.owner,
        None if request.days is None else request.days * _DAY_SECONDS,
        caller.requester,
    )
    return JSONDocument({**key_document(key), "secret": secret}, 201, {"Cache-Control": "no-store"})


@router.get("", response_model=KeyPage)
async def keys(_caller: Administrator, state: AppStateDep) -> Any:
    """List all keys, oldest first, without their secrets."""
    found = await state.run_blocking(state.store.keys.all)
    return JSONDocument({"items": [key_document(key) for key in found]})


@router.post("/{key}/revoke", response_model=KeyView)
async def revoke(
    key: Annotated[
        str,
        Path(pattern=r"^[0-9A-Za-z_-]{1,16}$", description="A key's `id`.", examples=["084ba7584b9e9c59"]),
    ],
    caller: Administrator,
    state: AppStateDep,
) -> Any:
    """Revoke a key. The service refuses it after at most a second."""
    return JSONDocument(
        key_document(await state.run_blocking(state.store.keys.revoke, key, caller.requester))
    )
