"""Owners of jobs and data sets, for operators: weights, quotas and use of the service."""

from typing import Annotated, Any

from fastapi import APIRouter, Path

from islands_api.admin_schemas import OwnerChanges, OwnerPage, OwnerView
from islands_api.web.auth import Administrator
from islands_api.web.dependencies import AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import JSONRoute
from islands_api.web.responses import JSONDocument, owner_document

router = APIRouter(
    prefix="/v1/admin/owners", tags=["administration"], responses=RESPONSES, route_class=JSONRoute
)

Name = Annotated[
    str,
    Path(
        min_length=1,
        max_length=64,
        pattern=r"^[^\x00-\x1f\x7f/]+$",
        description="Name of an owner.",
        examples=["lab"],
    ),
]


@router.get("", response_model=OwnerPage)
async def owners(_caller: Administrator, state: AppStateDep) -> Any:
    """List the owners of all keys, jobs and data sets."""
    found = await state.run_blocking(state.store.owners.all)
    return JSONDocument({"items": [owner_document(owner) for owner in found]})


@router.get("/{owner}", response_model=OwnerView)
async def owner(owner: Name, _caller: Administrator, state: AppStateDep) -> Any:
    """Return an owner."""
    return JSONDocument(owner_document(await state.run_blocking(state.store.owners.get, owner)))


@router.patch("/{owner}", response_model=OwnerView)
async def change(owner: Name, changes: OwnerChanges, caller: Administrator, state: AppStateDep) -> Any:
    """Change the weight and the quotas of an owner. They apply at once."""
    given = changes.model_dump(exclude_unset=True)
    changed = await state.run_blocking(state.store.owners.change, owner, given, caller.requester)
    return JSONDocument(owner_document(changed))
