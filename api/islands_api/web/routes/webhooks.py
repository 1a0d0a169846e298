"""Webhooks of an owner: create, list, delete, and their last deliveries."""

from typing import Annotated, Any

from fastapi import APIRouter, Path, Response

from islands_api.web.auth import Reader, Writer
from islands_api.web.dependencies import AppStateDep
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import JSONRoute
from islands_api.web.responses import JSONDocument, view_document
from islands_api.webhook_schemas import (
    CreatedWebhook,
    DeliveryPage,
    DeliveryView,
    WebhookPage,
    WebhookRequest,
    WebhookView,
)
from islands_service.outbound import OutboundFailedError, OutboundRefusedError

router = APIRouter(prefix="/v1/webhooks", tags=["webhooks"], responses=RESPONSES, route_class=JSONRoute)

#: Seconds that the resolution of a host may take.
_RESOLVE_SECONDS = 5.0

Id = Annotated[
    str,
    Path(
        pattern=r"^[0-9a-f]{32}$",
        description="A webhook's `id`.",
        examples=["5f0c2a9be1d34c6f8a7b6c5d4e3f2a1b"],
    ),
]


@router.post("", status_code=201, response_model=CreatedWebhook)
async def create(request: WebhookRequest, caller: Writer, state: AppStateDep) -> Any:
    """Create a webhook. Its secret is shown once."""
    try:
        await state.outbound.check_host(request.url, _RESOLVE_SECONDS)
    except OutboundFailedError as error:
        raise OutboundRefusedError(f"{error}: check the host of the URL, or try again later") from error
    webhook, secret = await state.run_blocking(
        state.store.webhooks.create,
        caller.owner,
        request.url,
        request.events,
        state.settings.max_webhooks,
        caller.requester,
    )
    return JSONDocument(
        {**view_document(webhook, WebhookView), "secret": secret}, 201, {"Cache-Control": "no-store"}
    )


@router.get("", response_model=WebhookPage)
async def webhooks(caller: Reader, state: AppStateDep) -> Any:
    """List your webhooks, oldest first, without their secrets."""
    found = await state.run_blocking(state.store.webhooks.all, caller.owner)
    return JSONDocument({"items": [view_document(webhook, WebhookView) for webhook in found]})


@router.delete("/{webhook}", status_code=204)
async def delete(webhook: Id, caller: Writer, state: AppStateDep) -> Response:
    """Delete a webhook and its deliveries."""
    await state.run_blocking(state.store.webhooks.delete, caller.owner, webhook, caller.requester)
    return Response(status_code=204)


@router.get("/{webhook}/deliveries", response_model=DeliveryPage)
async def deliveries(webhook: Id, caller: Reader, state: AppStateDep) -> Any:
    """Return the last 100 deliveries of a webhook, newest first. They are kept for a week."""
    found = await state.run_blocking(state.store.webhooks.deliveries, caller.owner, webhook)
    return JSONDocument({"items": [view_document(delivery, DeliveryView) for delivery in found]})
