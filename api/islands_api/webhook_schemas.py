"""Wire models of webhooks and their deliveries."""

from datetime import datetime
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from islands_api.schemas import ResponseModel
from islands_service.domain.webhook import EVENT_NAMES
from islands_service.outbound import MAX_URL


class WebhookRequest(BaseModel):
    """Request for a webhook."""

    model_config = ConfigDict(
        extra="forbid",
        json_schema_extra={
            "examples": [{"url": "https://hooks.example.org/islands", "events": ["job.succeeded"]}]
        },
    )

    url: Annotated[
        str,
        Field(
            min_length=1,
            max_length=MAX_URL,
            pattern=r"^[\x21-\x7e]+$",
            description="HTTPS URL that receives the events; its host has a public address.",
        ),
    ]
    events: Annotated[
        list[str],
        Field(
            min_length=1,
            max_length=len(EVENT_NAMES),
            description="Events to send; all by default.",
            json_schema_extra={"items": {"type": "string", "enum": list(EVENT_NAMES)}},
        ),
    ] = list(EVENT_NAMES)


class WebhookView(ResponseModel):
    """Webhook without its secret."""

    id: str
    url: str
    events: tuple[str, ...]
    created: datetime


class CreatedWebhook(WebhookView):
    """New webhook. This is the only response with its secret."""

    secret: str = Field(description="`whsec_` and the key of the signatures in Base64.")


class WebhookPage(ResponseModel):
    """All webhooks of an owner, oldest first."""

    items: tuple[WebhookView, ...]


class DeliveryView(ResponseModel):
    """Delivery of an event, with its last attempt."""

    id: str = Field(description="The header `webhook-id` of every attempt.")
    event: str
    job: str
    state: Literal["pending", "delivered", "failed"]
    attempts: int
    created: datetime
    attempted: datetime | None = None
    next_attempt: datetime | None = None
    status: int | None = Field(default=None, description="HTTP status of the last response.")
    error: str | None = Field(default=None, description="Why the last attempt failed.")


class DeliveryPage(ResponseModel):
    """Last deliveries of a webhook, newest first."""

    items: tuple[DeliveryView, ...]
