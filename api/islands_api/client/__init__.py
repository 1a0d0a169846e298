"""Python clients of the REST API, blocking and for asyncio. Read `islands_api.client.calls` first."""

from islands_api.client.asynchronous import AsyncClient
from islands_api.client.calls import JobRef
from islands_api.client.responses import Event, JobFailedError, ServiceError, ServiceUnreachableError
from islands_api.client.synchronous import Client

__all__ = [
    "AsyncClient",
    "Client",
    "Event",
    "JobFailedError",
    "JobRef",
    "ServiceError",
    "ServiceUnreachableError",
]
