"""Calls of webhooks, which the service calls when jobs end and monitors raise alarms."""

from collections.abc import Sequence

from islands_api.client.calls import RequestSpec, quote_id
from islands_api.client.response_parsing import read_as
from islands_api.webhook_schemas import (
    CreatedWebhook,
    DeliveryPage,
    DeliveryView,
    WebhookPage,
    WebhookView,
)

#: Webhook or its id.
WebhookRef = WebhookView | str


def create_webhook(url: str, events: Sequence[str] | None = None) -> RequestSpec[CreatedWebhook]:
    """Create a webhook and return it with its secret, which no other call returns.

    Parameters
    ----------
    url : str
        HTTPS URL that receives the events.
    events : sequence of str, optional
        Some of ``job.succeeded``, ``job.failed``, ``job.cancelled`` and ``monitor.alarm``; all by default.
    """
    asked = {"url": url, **({} if events is None else {"events": list(events)})}
    return RequestSpec("POST", "/v1/webhooks", read_as(CreatedWebhook), json=asked, repeatable=False)


def webhooks() -> RequestSpec[tuple[WebhookView, ...]]:
    """Return all webhooks, oldest first."""
    page = read_as(WebhookPage)
    return RequestSpec("GET", "/v1/webhooks", lambda response: page(response).items)


def delete_webhook(which: WebhookRef) -> RequestSpec[None]:
    """Delete a webhook and its deliveries."""
    return RequestSpec("DELETE", f"/v1/webhooks/{quote_id(which)}", lambda _: None, repeatable=False)


def deliveries(which: WebhookRef) -> RequestSpec[tuple[DeliveryView, ...]]:
    """Return the last hundred deliveries of a webhook, newest first."""
    page = read_as(DeliveryPage)
    return RequestSpec(
        "GET", f"/v1/webhooks/{quote_id(which)}/deliveries", lambda response: page(response).items
    )
