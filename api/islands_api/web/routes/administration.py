"""Keys, owners and the jobs of all owners, for operators."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Query

from islands_api.admin_schemas import (
    CreatedKey,
    KeyPage,
    KeyRequest,
    KeyView,
    OwnerChanges,
    OwnerPage,
    OwnerView,
)
from islands_api.schemas import OwnedJobPage, OwnedJobView
from islands_api.web.auth import Administrator
from islands_api.web.dependencies import AppStateDep
from islands_api.web.job_submission import describe_job, describe_jobs
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import Cursor, JSONRoute, Limit, decode_cursor, encode_cursor
from islands_api.web.responses import JSONDocument, owner_document, view_document
from islands_api.web.routes.jobs import Id, StateFilter

router = APIRouter(prefix="/v1/admin", tags=["administration"], responses=RESPONSES, route_class=JSONRoute)

_DAY_SECONDS = 86_400.0

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


@router.post("/keys", status_code=201, response_model=CreatedKey)
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
    return JSONDocument({**view_document(key, KeyView), "secret": secret}, 201, {"Cache-Control": "no-store"})


@router.get("/keys", response_model=KeyPage)
async def keys(_caller: Administrator, state: AppStateDep) -> Any:
    """List all keys, oldest first, without their secrets."""
    found = await state.run_blocking(state.store.keys.all)
    return JSONDocument({"items": [view_document(key, KeyView) for key in found]})


@router.post("/keys/{key}/revoke", response_model=KeyView)
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
        view_document(await state.run_blocking(state.store.keys.revoke, key, caller.requester), KeyView)
    )


@router.get("/owners", response_model=OwnerPage)
async def owners(_caller: Administrator, state: AppStateDep) -> Any:
    """List the owners of all keys, jobs and data sets."""
    found = await state.run_blocking(state.store.owners.all)
    return JSONDocument({"items": [owner_document(owner) for owner in found]})


@router.get("/owners/{owner}", response_model=OwnerView)
async def owner(owner: Name, _caller: Administrator, state: AppStateDep) -> Any:
    """Return an owner."""
    return JSONDocument(owner_document(await state.run_blocking(state.store.owners.get, owner)))


@router.patch("/owners/{owner}", response_model=OwnerView)
async def change(owner: Name, changes: OwnerChanges, caller: Administrator, state: AppStateDep) -> Any:
    """Change the weight and the quotas of an owner. They apply at once."""
    given = changes.model_dump(exclude_unset=True)
    changed = await state.run_blocking(state.store.owners.change, owner, given, caller.requester)
    return JSONDocument(owner_document(changed))


@router.get("/jobs", response_model=OwnedJobPage)
async def jobs(
    _caller: Administrator,
    state: AppStateDep,
    owner: Annotated[
        str | None, Query(min_length=1, max_length=64, description="Only jobs of this owner.")
    ] = None,
    job_state: StateFilter = None,
    cursor: Cursor = None,
    limit: Limit = 50,
) -> Any:
    """List the jobs of all owners, newest first."""
    page = await state.run_blocking(state.store.jobs.page, owner, job_state, decode_cursor(cursor), limit)
    documents = await describe_jobs(state, page.jobs)
    items = [{**document, "owner": job.owner} for document, job in zip(documents, page.jobs, strict=True)]
    return JSONDocument({"items": items, "next": encode_cursor(page.after)})


@router.post("/jobs/{job}/cancel", status_code=202, response_model=OwnedJobView)
async def cancel(job: Id, caller: Administrator, state: AppStateDep) -> Any:
    """Cancel a job of any owner, as its owner could. The audit trail has the key of the administrator."""
    cancelled = await state.run_blocking(state.store.jobs.cancel, None, job, caller.requester)
    return JSONDocument({**await describe_job(state, cancelled), "owner": cancelled.owner}, 202)
